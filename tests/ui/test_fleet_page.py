"""The fleet page in a real browser, with a real broker and robots by another implementation."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from robot_stack.cli.fleet import _instant_action, _request_state
from robot_stack.cli.fleet_page import FleetPage
from robot_stack.cli.fleet_robots import STALE_S
from robot_stack.cli.fleet_site import Files
from robot_stack.core.config import load
from robot_stack.ui.params import TouchUiParams
from robot_stack.ui.pin import hash_pin
from tests.support.fleet.broker import Peer, RunningBroker, running_broker
from tests.support.fleet.foreign_robot import MAKER, ForeignRobot
from tests.support.fleet.orders import order
from tests.support.ui_page import PIN
from tests.support.waiting import wait_for
from tests.ui.conftest import DEADLINE_MS, set_silence_limit, until
from tests.ui.test_access_for_all import AXE, RULES

SIZES = {"phone": {"width": 390, "height": 844}, "desktop": {"width": 1280, "height": 800}}
WIDE = "document.documentElement.scrollWidth > innerWidth"


class Served:
    """The page's server in this process, with a clock that only a test advances."""

    def __init__(self, broker: RunningBroker, files: Files | None, bind: str | None = None, pin: str = "") -> None:
        self.now_s = 0.0
        screen = load(TouchUiParams, "touch_ui")
        if pin:
            access = screen.access.model_copy(update={"pin_hash": hash_pin(pin)})
            screen = screen.model_copy(update={"access": access})
        self._page = FleetPage(broker.params(files), broker.site, screen, 0, bind, "yard", lambda: self.now_s)
        self.url = self._page.url
        self._stop = threading.Event()
        arguments = (self._stop.is_set, _request_state, lambda robot: _instant_action("cancelOrder", robot))
        self._thread = threading.Thread(target=self._page.run, args=arguments, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._stop.set()
        self._thread.join(30.0)


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[RunningBroker]:
    with running_broker(tmp_path / "site", local=True) as running:
        yield running


@pytest.fixture
def served(broker: RunningBroker) -> Iterator[Served]:
    with closing(Served(broker, None)) as found:
        yield found


@contextmanager
def opened(browser: Any, url: str, size: str) -> Iterator[Any]:
    """Fails on an error of the page's script or a violation of its security policy."""
    context = browser.new_context(viewport=SIZES[size], has_touch=True, ignore_https_errors=True)
    context.set_default_timeout(DEADLINE_MS)
    page = context.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.goto(url)
    until(page, "window.touchUi?.link.state.shown !== undefined")
    set_silence(page)
    yield page
    context.close()
    assert [text for text in errors if "ERR_CONNECTION" not in text] == []


def set_silence(page: Any) -> None:
    page.evaluate("window.touchUi.link.state.link = {}")
    set_silence_limit(page, 60.0)


def on_map(page: Any, x_m: float, y_m: float) -> tuple[float, float]:
    """Where the whole map shows a place, in pixels of the window."""
    box = page.locator("#map").bounding_box()
    about = page.evaluate("window.touchUi.link.state.site.map")
    scale = min(box["width"] / about["width"], box["height"] / about["height"])
    across_m, up_m = x_m - about["x"] - about["width"] / 2, y_m - about["y"] - about["height"] / 2
    return box["x"] + box["width"] / 2 + scale * across_m, box["y"] + box["height"] / 2 - scale * up_m


def send(broker: RunningBroker, data: dict[str, Any], files: Files | None = None) -> None:
    header = {"headerId": 1, "timestamp": "2026-01-01T00:00:00.00Z", "version": "2.1.0", "manufacturer": MAKER}
    peer = Peer(broker.params(files), "sender").connected()
    peer.publish(f"uagv/v2/{MAKER}/{data['serialNumber']}/order", json.dumps({**header, **data}))
    peer.close()


@pytest.mark.parametrize("size", SIZES)
def test_order_is_shown_and_cancelled(browser: Any, broker: RunningBroker, served: Served, size: str) -> None:
    robots = [ForeignRobot(broker.site.robot_url(), serial, waits=True) for serial in ("F1", "F2")]
    with closing(robots[0]) as robot, closing(robots[1]), opened(browser, served.url, size) as page:
        page.wait_for_selector('[data-robot="F2"][data-condition="idle"]')
        send(broker, order("o-1", ["start", "a", "b"], serialNumber="F1"))
        wait_for(lambda: robot.orders, "the order")
        robot.release()
        page.wait_for_selector('[data-robot="F1"] progress[value="0.5"]')
        page.mouse.click(*on_map(page, 2.0, 2.0))
        assert "o-1: nodes left: 1" in page.inner_text('[data-robot="F1"]')
        assert page.evaluate("window.touchUi.link.state['robot:uagv/v2/foreign/F1'].way") == [[3, 2, True]]
        page.click('[data-do="cancel"]')
        page.click('[data-do="no"]')
        page.click('[data-do="cancel"]')
        assert "Cancel order o-1 of F1?" in page.inner_text('[role="alertdialog"]')
        assert not page.evaluate(WIDE)
        page.evaluate(AXE)
        assert page.evaluate(RULES) == []
        page.click('[data-do="yes"]')
        page.wait_for_selector('[data-cancel="finished"]')
        page.click('.languages [lang="ja"]')
        wait_for(lambda: "指示を取り消しました" in page.inner_text('[data-robot="F1"]'), "Japanese")


def test_robots_that_are_silent_or_lost(browser: Any, broker: RunningBroker, served: Served) -> None:
    one, two = (ForeignRobot(broker.site.robot_url(), serial, state_interval_s=1000.0) for serial in ("F1", "F2"))
    with closing(one), opened(browser, served.url, "phone") as page:
        page.wait_for_selector('[data-robot="F1"][data-condition="idle"]')
        two.lose()
        page.wait_for_selector('[data-robot="F2"][data-condition="lost"]')
        served.now_s = STALE_S + 10.0
        page.wait_for_selector('[data-robot="F1"][data-condition="stale"]')
        assert "more than 40 s ago" in page.inner_text('[data-robot="F1"]')


def test_broker_and_page_lost_and_found(browser: Any, broker: RunningBroker, served: Served) -> None:
    peer = Peer(broker.params(), "robot").connected()
    peer.publish(f"uagv/v2/{MAKER}/K1/connection", '{"connectionState": "ONLINE"}', retain=True)
    with opened(browser, served.url, "desktop") as page:
        page.wait_for_selector('[data-robot="K1"]')
        broker.kill()
        page.wait_for_selector(".broker-lost")
        assert "No connection to the broker" in page.inner_text(".broker-lost")
        assert page.is_visible('[data-robot="K1"]')
        broker.start()
        page.wait_for_selector(".broker-lost", state="detached")
        served.close()
        page.wait_for_selector(".broker-lost")
        assert "This page has lost its connection" in page.inner_text(".broker-lost")


def test_hostile_robots(browser: Any, broker: RunningBroker, served: Served) -> None:
    peer = Peer(broker.params(), "peer").connected()
    evil = "<img src=x onerror=document.title='owned'>"
    names = ("K1", evil.replace("/", ""), "K" * 200, "L" * 400)
    state = {
        "orderId": evil + "o" * 5000,
        "operatingMode": evil,
        "nodeStates": [{"sequenceId": "x", "nodePosition": {"x": float("nan"), "y": 10**400}}, 7, None] * 200,
        "agvPosition": {"x": float("nan"), "y": float("inf"), "theta": "north", "mapId": evil},
        "batteryState": {"batteryCharge": 1e300, "charging": "yes"},
        "errors": [{"errorLevel": evil, "errorType": evil, "errorDescription": "\u202eabc" * 50}] * 100,
        "loads": evil,
        "safetyState": {"eStop": "NONE"},
        "actionStates": [{"actionStatus": ["FINISHED"]}],
    }
    for name in names:
        peer.publish(f"uagv/v2/{MAKER}/{name}/connection", '{"connectionState": "ONLINE"}', retain=True)
        peer.publish(f"uagv/v2/{MAKER}/{name}/state", json.dumps(state), retain=True)
    peer.close()
    with opened(browser, served.url, "phone") as page:
        until(page, "document.querySelectorAll('[data-robot]').length === 3")
        assert "not shown: 1" in page.inner_text(".list")
        page.click('[data-robot="K1"] > button')
        page.wait_for_selector("[data-error]")
        assert "Position unknown" in page.inner_text('[data-robot="K1"]')
        assert "onerror" in page.inner_text('[data-robot="K1"]'), "as text"
        assert page.evaluate("[document.title, document.querySelectorAll('.list img').length]") == ["Fleet", 0]
        assert not page.evaluate(WIDE)
        for message in ("{", '{"t": "cancel"}', json.dumps({"t": "cancel", "robot": "?", "order": "x", "id": 1})):
            page.evaluate("(text) => window.touchUi.link.socket.send(text)", message)
        answer = page.evaluate("window.touchUi.link.ask({ t: 'cancel', robot: 'no', order: 'x', pin: '' })")
        assert answer["why"] == "fleet.not_online"


@pytest.fixture(scope="module")
def secured(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[RunningBroker, Peer]]:
    """A broker that asks for certificates, and the robot F1 with an order."""
    with running_broker(tmp_path_factory.mktemp("site")) as broker:
        topic = f"uagv/v2/{MAKER}/F1"
        robot = Peer(broker.params(broker.site.add_robot("F1")), "F1").connected().subscribe(f"{topic}/instantActions")
        state = {"orderId": "o-1", "nodeStates": [{"sequenceId": 2, "released": True}], "version": "2.1.0"}
        robot.publish(f"{topic}/connection", '{"connectionState": "ONLINE"}', retain=True)
        robot.publish(f"{topic}/state", json.dumps(state), retain=True)
        yield broker, robot
        robot.close()


@pytest.mark.parametrize("bind", [None, "127.0.0.1"])
def test_the_page_needs_its_link_and_elsewhere_the_pin(
    browser: Any, secured: tuple[RunningBroker, Peer], bind: str | None
) -> None:
    broker, robot = secured
    robot.received.clear()
    with closing(Served(broker, broker.site.master(), bind, PIN)) as served:
        context = browser.new_context(ignore_https_errors=True)
        assert context.new_page().goto(served.url.partition("?")[0]).status == 403
        context.close()
        with opened(browser, served.url, "phone") as page:
            page.click('[data-robot="F1"] > button')
            page.click('[data-do="cancel"]')
            if bind is not None:
                page.fill("input", "0000")
                page.click('[data-do="yes"]')
                page.wait_for_selector('[data-why="fleet.wrong_pin"]')
                page.fill("input", PIN)
            page.click('[data-do="yes"]')
            page.wait_for_selector('[data-cancel="sent"]')

    def cancelled() -> int:
        sent = [json.loads(text) for text in robot.payloads(f"uagv/v2/{MAKER}/F1/instantActions")]
        return [action["actionType"] for item in sent for action in item["actions"]].count("cancelOrder")

    wait_for(cancelled, "the cancellation")
    assert cancelled() == 1

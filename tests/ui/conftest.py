"""A real Chromium on the touch screen's page; the node is real, DDS peers replace the rest of the robot."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

from robot_stack.ui.pin import hash_pin
from tests.support.processes import NodeProcess, Start
from tests.support.ui_page import PIN, web_page
from tests.support.ui_robot import StandInRobot
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.peer import Peer

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
# Like a kiosk; the sandbox needs rights that root in a container does not have.
OPTIONS = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]
DEADLINE_MS = 120_000
PATIENT_S = 60.0
STAFF_PAGES = (
    "map",
    "drive",
    "docking",
    "display",
    "faults",
    "self_test",
    "diagnostics",
    "missions",
    "history",
    "recordings",
    "events",
    "settings",
)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine: install the package chromium to run the tests of the pages")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def screen(shared_start: Start, browser: Any) -> NodeProcess:
    """The node."""
    pin = f"access.pin_hash:='{hash_pin(PIN)}'"
    process = shared_start("touch_ui", "-p", "server.port:=0", "-p", pin)
    process.wait_output("serving http")
    return process


@pytest.fixture(scope="module")
def url(screen: NodeProcess) -> str:
    """The address of the node's page."""
    found = re.search(r"serving (http://\S+)", screen.output())
    assert found is not None
    return found[1]


@pytest.fixture(scope="module")
def stand_in(shared_peer: Peer, screen: NodeProcess) -> StandInRobot:
    return StandInRobot(shared_peer)


@pytest.fixture
def robot(stand_in: StandInRobot, url: str) -> StandInRobot:
    """A robot at rest that has received nothing; the screen shows it and is not pressed."""
    pressed = stand_in.screen_pressed
    stand_in.reset()
    with web_page(port_of(url)) as page:
        if pressed:
            assert page.log_in().ask("reset")["ok"]
            wait_for(lambda: "stop False" in stand_in.commands, "the release")
            stand_in.commands.clear()
        wait_for(lambda: _at_rest(page.state), "the screen to show the robot at rest")
    return stand_in


def port_of(url: str) -> int:
    return int(url.split(":")[2].split("/")[0])


def _at_rest(state: dict[str, Any]) -> bool:
    safety, ride, queue = (state.get(name, {}) for name in ("safety", "ride", "queue"))
    return (safety.get("state"), ride.get("state")) == ("NORMAL", "IDLE") and not queue.get("orders")


@pytest.fixture
def page(browser: Any, robot: StandInRobot, url: str, screen: NodeProcess) -> Iterator[Any]:
    """The rider's page, connected, 1280x800. An error on the page fails the test."""
    from playwright.sync_api import TimeoutError as PageTimeout

    context = browser.new_context(viewport={"width": 1280, "height": 800}, has_touch=True)
    context.set_default_timeout(DEADLINE_MS)
    page = context.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.goto(url)
    try:
        page.wait_for_selector("[data-mission]")
    except PageTimeout as error:
        shown = page.evaluate("[document.body.innerText, window.touchUi?.link.lost, window.touchUi?.link.state]")
        raise AssertionError(f"no destinations: {shown}, {errors}; the node: {screen.output()}") from error
    set_silence_limit(page, PATIENT_S)
    yield page
    context.close()
    lost = ("ERR_CONNECTION", "ERR_INTERNET", "ERR_SOCKET_NOT_CONNECTED")  # a page whose link ends recovers
    assert [text for text in errors if not any(code in text for code in lost)] == []


def set_silence_limit(page: Any, seconds: float) -> None:
    """Replaces the node's limit in this page: a node without processor time is not a lost link."""
    page.evaluate(f"window.touchUi.link.state.link.silence_s = {seconds}")


def unlock(page: Any) -> None:
    """Logs in as staff with the keys of the PIN dialog."""
    page.click("#to-staff")
    for digit in PIN:
        page.click(f'[data-key="{digit}"]')
    page.click("#unlock")
    page.wait_for_selector("nav")


def until(page: Any, expression: str) -> None:
    """Waits until JavaScript is true; the page's security policy forbids playwright's own method."""
    wait_for(lambda: page.evaluate(expression), expression, poll_s=0.05)


def h2(page: Any) -> str:
    return str(page.evaluate("document.querySelector('h2')?.textContent ?? ''"))

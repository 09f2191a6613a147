"""The fleet page: robots, map and cancelling of orders in a browser, from MQTT alone.

Two threads: the command's own one reads the broker; the web server's one talks to the pages.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import queue
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import Field, StringConstraints, TypeAdapter, ValidationError

from robot_stack.cli.errors import WRONG_USE, CommandError
from robot_stack.cli.fleet_broker import Fleet
from robot_stack.cli.fleet_robots import Outcome, Robot, actions_progress, errors_of, section
from robot_stack.cli.fleet_site import Site
from robot_stack.core.config import ConfigError
from robot_stack.fleet.link import Topic
from robot_stack.fleet.mqtt_params import BrokerParams
from robot_stack.ui import protocol as p
from robot_stack.ui.access import Access
from robot_stack.ui.changes import Changes
from robot_stack.ui.nodes.hub import REFUSED_MAX, TICK_S
from robot_stack.ui.nodes.server import TYPES, WEB, WebServer
from robot_stack.ui.nodes.site import background
from robot_stack.ui.params import AccessParams, ServerParams, TouchUiParams
from robot_stack.ui.pin import verify_pin

PAGE: Final = Path(__file__).resolve().parent / "web" / "fleet"
ROBOTS_MAX: Final = 200
_LONGEST_PREFIX: Final = 300
_REFRESH_S: Final = 0.5
_RETRY_S: Final = 2.0
_ACCEPT_S: Final = 10.0
_PAGE_HZ: Final = 2.0
_MESSAGES_HZ_MAX: Final = 20.0


class Right(StrEnum):
    """To cancel orders."""

    FREE = "free"
    PIN = "pin"
    NONE = "none"


class Cancel(p.Message):
    """order: as the page shows it, so that no other order is cancelled. pin: only where it is needed."""

    t: Literal["cancel"]
    robot: Annotated[str, StringConstraints(max_length=_LONGEST_PREFIX)]
    order: Annotated[str, StringConstraints(max_length=64)]
    pin: Annotated[str, StringConstraints(pattern=r"^[0-9]{0,12}$")] = ""


_MESSAGES: TypeAdapter[p.Alive | p.Show | Cancel] = TypeAdapter(
    Annotated[p.Alive | p.Show | Cancel, Field(discriminator="t")]
)


@dataclass(frozen=True, slots=True)
class Wish:
    """A cancellation that a page may make. answer: receives whether it was sent, and if not, the key of the reason."""

    robot: str
    order: str
    who: str
    answer: Callable[[bool, str], None]


class Page:
    """One browser."""

    def __init__(self, number: int, address: str, now_s: float) -> None:
        self.number, self.who = number, f"page {number} {address}"
        self.changes = Changes(_PAGE_HZ)
        self.answers: list[str] = []
        self.refused = 0
        self.allowance, self.counted_s = _MESSAGES_HZ_MAX, now_s
        self.something = asyncio.Event()

    def flooding(self, now_s: float) -> bool:
        gained = (now_s - self.counted_s) * _MESSAGES_HZ_MAX
        self.allowance, self.counted_s = min(self.allowance + gained, _MESSAGES_HZ_MAX) - 1.0, now_s
        return self.allowance < 0.0


class FleetHub:
    """The pages, in the server's loop. cancel: takes a permitted cancellation; called in that loop."""

    def __init__(self, access: AccessParams, right: Right, pages_max: int, cancel: Callable[[Wish], None]) -> None:
        self._access, self._pin_hash = Access(access), access.pin_hash
        self._right, self._pages_max, self._cancel = right, pages_max, cancel
        self._pages: dict[int, Page] = {}
        self._sections: dict[str, Any] = {"rights": {"cancel": right.value}}
        self._number = 0
        self._tasks: set[asyncio.Task[None]] = set()

    def full(self) -> bool:
        return len(self._pages) >= self._pages_max

    def join(self, address: str) -> Page:
        self._number += 1
        page = Page(self._number, address, time.monotonic())
        page.changes.offer(self._sections)
        self._pages[page.number] = page
        self._access.enter(page.number, time.monotonic())
        return page

    def leave(self, page: Page) -> None:
        self._pages.pop(page.number, None)
        self._access.leave(page.number)

    def push(self, sections: Mapping[str, Any]) -> None:
        self._sections |= sections
        for page in self._pages.values():
            page.changes.offer(sections)
            page.something.set()

    def on_message(self, page: Page, text: str | bytes | None) -> bool:
        """False: the page is to be closed."""
        if page.flooding(time.monotonic()):
            return False
        try:
            if not isinstance(text, str) or len(text) > p.MESSAGE_BYTES_MAX:
                raise ValueError("no short text")
            message = _MESSAGES.validate_json(text)
        except (ValidationError, ValueError):
            page.refused += 1
            return page.refused < REFUSED_MAX
        if isinstance(message, Cancel):
            self._ask(page, message)
        return True

    async def send(self, page: Page, text: Callable[[str], Any], _data: Callable[[bytes], Any]) -> None:
        """Sends changes, answers, and a sign of life each second, until it is cancelled."""
        while True:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(page.something.wait(), TICK_S)
            page.something.clear()
            answers, page.answers = page.answers, []
            for item in answers:
                await text(item)
            changed = page.changes.take(time.monotonic())
            await text(json.dumps({"t": "state", "v": changed}, allow_nan=False) if changed else '{"t":"tick"}')

    # --- cancelling --------------------------------------------------------------------------------------------------

    def _ask(self, page: Page, message: Cancel) -> None:
        def answer(ok: bool, why: str) -> None:
            page.answers = [*page.answers[-20:], json.dumps({"t": "answer", "id": message.id, "ok": ok, "why": why})]
            page.something.set()

        wish = Wish(message.robot, message.order, page.who, answer)
        if self._right is Right.FREE:
            self._cancel(wish)
        elif self._right is Right.NONE:
            answer(False, "fleet.read_only")
        elif not self._access.begin_check(page.number, time.monotonic()):
            answer(False, "fleet.pin_wait")
        else:
            task = asyncio.get_running_loop().create_task(self._check(page, message.pin, wish))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _check(self, page: Page, pin: str, wish: Wish) -> None:
        """Each cancellation needs the PIN: no session."""
        right = False
        try:
            right = await asyncio.to_thread(verify_pin, self._pin_hash, pin)
        finally:
            self._access.end_check(page.number, right, time.monotonic())
            self._access.dismiss(page.number)
        if right:
            self._cancel(wish)
        else:
            print(f"{wish.who}: wrong PIN", flush=True)
            wish.answer(False, "fleet.wrong_pin")


class FleetPicture:
    """The robots as pages see them, and the cancellations under way. Times are steady seconds."""

    def __init__(self) -> None:
        self.robots: dict[str, Robot] = {}
        self._received_s: dict[str, dict[Topic, float]] = {}
        self._cancels: dict[str, tuple[float, Mapping[str, Any], Any, str]] = {}

    def received(self, robot: Robot, topic: Topic, now_s: float) -> None:
        self._received_s.setdefault(robot.prefix, {})[topic] = now_s

    def cancelled(self, robot: Robot, message: Mapping[str, Any], now_s: float) -> None:
        state = robot.messages[Topic.STATE]
        self._cancels[robot.prefix] = (now_s, message, errors_of(state), robot.order)

    def refusal(self, wish: Wish) -> str:
        """Key of the reason why it cannot be sent; empty if it can."""
        robot = self.robots.get(wish.robot)
        if robot is None or robot.connection != "ONLINE":
            return "fleet.not_online"
        return "" if wish.order and wish.order == robot.order else "fleet.order_changed"

    def sections(self, now_s: float) -> dict[str, Any]:
        prefixes = sorted(prefix for prefix in self.robots if len(prefix) <= _LONGEST_PREFIX)
        found: dict[str, Any] = {
            f"robot:{prefix}": {
                **section(self.robots[prefix], self._received_s.get(prefix, {}), now_s),
                "cancel": self._cancel_state(self.robots[prefix], now_s),
            }
            for prefix in prefixes[:ROBOTS_MAX]
        }
        found["shown"] = {"prefixes": prefixes[:ROBOTS_MAX], "more": len(self.robots) - len(prefixes[:ROBOTS_MAX])}
        return found

    def _cancel_state(self, robot: Robot, now_s: float) -> str:
        """As a text's key, until another order is shown."""
        sent_s, message, before, order = self._cancels.get(robot.prefix, (0.0, {}, (), ""))
        if not message or order != robot.order:
            return ""
        progress = actions_progress(message, robot.messages[Topic.STATE], before)
        if progress.outcome is Outcome.RUNNING and not progress.accepted:
            return "unanswered" if now_s - sent_s > _ACCEPT_S else "sent"
        return {Outcome.RUNNING: "running", Outcome.FINISHED: "finished", Outcome.FAILED: "failed"}[progress.outcome]


class FleetPage:
    """Serves the page until ``stopped`` is true. Raises CommandError.

    bind: None for this computer alone. map_name: by default the touch screen's. now_s: steady seconds.
    """

    def __init__(
        self,
        params: BrokerParams,
        site: Site,
        screen: TouchUiParams,
        port: int,
        bind: str | None = None,
        map_name: str | None = None,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        map_name = screen.pages.map if map_name is None else map_name
        try:
            about, png = background(map_name)
        except ConfigError as error:
            raise CommandError(str(error), WRONG_USE) from None
        self._now_s = now_s
        self._params, self._picture = params, FleetPicture()
        self._wishes: queue.Queue[Wish] = queue.Queue(100)
        right = Right.FREE if bind is None else Right.PIN if screen.access.pin_hash else Right.NONE
        self._hub = FleetHub(screen.access, right, screen.server.clients_max, self._take)
        server = server_params(screen.server, site, port, bind, token=params.tls)
        try:
            self._server = WebServer(server, self._hub, page_files(png), cookie="fleet_page")
        except ConfigError as error:
            raise CommandError(str(error).replace("touch_ui: ", "")) from None
        self.url = self._server.url
        if bind in ("0.0.0.0", "::"):
            self.url = f"https://{site.names()[0]}:{self._server.port}/"
        if server.token:
            self.url += f"?token={server.token}"
        place = None if about is None else {**about, "id": Path(map_name).name}
        self._push({"site": {"map": place, "language": screen.pages.language}})

    def run(
        self,
        stopped: Callable[[], bool],
        request_state: Callable[[Fleet, Robot, Topic], None],
        cancel_message: Callable[[Robot], dict[str, Any]],
    ) -> None:
        """request_state, cancel_message: of the command line, for a robot."""
        try:
            while not stopped():
                try:
                    with Fleet(self._params) as connected:
                        connected.robots = self._picture.robots
                        self._push({"broker": {"lost": False, "why": ""}})
                        while not stopped():
                            for robot, topic in connected.updates(_REFRESH_S):
                                self._picture.received(robot, topic, self._now_s())
                                request_state(connected, robot, topic)
                            self._cancel_wishes(connected, cancel_message)
                            self._push(self._picture.sections(self._now_s()))
                except CommandError as error:
                    self._push({"broker": {"lost": True, "why": str(error)}})
                    self._refuse_wishes()
                    end_s = time.monotonic() + _RETRY_S
                    while time.monotonic() < end_s and not stopped():
                        time.sleep(0.1)
        finally:
            self._server.close()

    def _push(self, sections: Mapping[str, Any]) -> None:
        self._server.call(self._hub.push, sections)

    def _take(self, wish: Wish) -> None:
        try:
            self._wishes.put_nowait(wish)
        except queue.Full:
            wish.answer(False, "fleet.no_broker")

    def _cancel_wishes(self, connected: Fleet, cancel_message: Callable[[Robot], dict[str, Any]]) -> None:
        while not self._wishes.empty():
            wish = self._wishes.get_nowait()
            why = self._picture.refusal(wish)
            if not why:
                robot = self._picture.robots[wish.robot]
                try:
                    message = cancel_message(robot)
                    connected.send(robot, Topic.INSTANT_ACTIONS, message)
                    self._picture.cancelled(robot, message, self._now_s())
                except CommandError:  # of a version that is not written here
                    why = "fleet.other_version"
            print(f"{wish.who}: cancels order {wish.order!r} of {wish.robot!r}: {why or 'sent'}", flush=True)
            self._server.call(wish.answer, not why, why)

    def _refuse_wishes(self) -> None:
        while not self._wishes.empty():
            self._server.call(self._wishes.get_nowait().answer, False, "fleet.no_broker")


def server_params(screen: ServerParams, site: Site, port: int, bind: str | None, *, token: bool) -> ServerParams:
    """With the touch screen's limits. bind: with the broker's certificate; always with a token. Raises CommandError."""
    own: dict[str, Any] = {"address": "127.0.0.1", "tls_certificate": "", "tls_key": "", "token": "", "host_names": ()}
    if bind is not None:
        certificate, key = site.server()
        names = tuple(name for name in site.names() if re.fullmatch(r"[A-Za-z0-9.-]+", name))
        own = {"address": bind, "tls_certificate": str(certificate), "tls_key": str(key), "host_names": names}
    if token or bind is not None:
        own["token"] = site.page_token()
    try:
        return ServerParams.model_validate({**screen.model_dump(), **own, "port": port, "ports": 1})
    except ValidationError as error:
        raise CommandError(f"--bind: {error.errors()[0]['msg'].removeprefix('Value error, ')}", WRONG_USE) from None


def texts() -> dict[str, dict[str, str]]:
    """The touch screen's, for the faults of the safety monitor and languages, with the page's own."""
    shared: dict[str, dict[str, str]] = json.loads((WEB / "texts.json").read_text(encoding="utf-8"))
    own: dict[str, dict[str, str]] = json.loads((PAGE / "texts.json").read_text(encoding="utf-8"))
    return shared | own


def page_files(map_png: bytes) -> dict[str, tuple[str, bytes]]:
    """Path -> (type, bytes), beside the files of the touch screen."""
    found = {
        f"/{path.name}": (TYPES[path.suffix], path.read_bytes()) for path in PAGE.iterdir() if path.suffix in TYPES
    }
    found["/texts.json"] = ("application/json", json.dumps(texts(), ensure_ascii=False).encode())
    return found | ({"/map.png": ("image/png", map_png)} if map_png else {})

"""The pages: their state, rights and pending updates. Everything here runs in the server's loop.

A stop and the pad are executed from here, without waiting for the node's own loop; all else is passed to it.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from robot_stack.contract.states import HeldBy
from robot_stack.core.geometry import Twist2
from robot_stack.ui import protocol as p
from robot_stack.ui.access import Access, Role
from robot_stack.ui.changes import Changes
from robot_stack.ui.desk import OK, WAIT, Desk
from robot_stack.ui.pad import DeadManPad
from robot_stack.ui.params import TouchUiParams
from robot_stack.ui.pin import verify_pin

# Period of messages that show a page that its link is alive.
TICK_S = 1.0
PAD_PERIOD_S = 0.05
# A page with this many invalid messages is broken or hostile.
REFUSED_MAX = 20
_FLOOD_MAX = 200
WRONG_PIN = "answer.wrong_pin"
INVALID = "answer.invalid"


class Robot(Protocol):
    """The hub's interface to the node; each may be called from the hub's thread and returns at once."""

    def stop(self) -> None: ...
    def drive(self, twist: Twist2) -> None: ...
    def carry_out(self, client: int, message: p.ClientMessage) -> None: ...
    def request_layers(self, layers: frozenset[p.Layer]) -> None: ...
    def audit(self, who: str, what: str, outcome: str) -> None: ...


class Page:
    """One connected page."""

    def __init__(self, number: int, address: str, rate_hz: float) -> None:
        self.number, self.address = number, address
        self.changes = Changes(rate_hz)
        self.layers: frozenset[p.Layer] = frozenset()
        self.ready: set[p.Layer] = set()
        self.frames: dict[p.Layer, bytes] = {}
        self.answers: list[str] = []
        self.alive_s = float("-inf")
        self.tests_opened = 0
        self.refused = 0
        self.floods = 0
        self.something = asyncio.Event()


class Hub:
    """now_s: steady seconds."""

    def __init__(self, params: TouchUiParams, robot: Robot, now_s: Callable[[], float] = time.monotonic) -> None:
        self._params, self._robot, self._now_s = params, robot, now_s
        self._desk = Desk(Access(params.access), DeadManPad(params.pad), params.server.messages_hz_max)
        self._numbers = itertools.count(1)
        self._pages: dict[int, Page] = {}
        self._sections: dict[str, Any] = {}
        self._layers: dict[p.Layer, Any] = {}
        self._wanted: frozenset[p.Layer] = frozenset()
        self._tasks: set[asyncio.Task[None]] = set()
        self._driving = False
        # Read by the node's thread; replaced, never changed.
        self.awaited: frozenset[p.Layer] = frozenset()
        self.connected = self.pages = 0
        self.testers: Mapping[int, int] = {}  # pages that show the self test, and how often they have opened it

    def stopped(self) -> None:
        """Handles an emergency stop. Called from the node's own loop."""
        self._desk.pad.stopped()

    # --- pages -------------------------------------------------------------------------------------------------------

    def full(self) -> bool:
        return len(self._pages) >= self._params.server.clients_max

    def join(self, address: str) -> Page:
        page = Page(next(self._numbers), address, self._params.pages.state_hz)
        page.changes.offer({**self._sections, "link": {"silence_s": self._params.server.page_silence_s}})
        self._desk.enter(page.number, self._now_s())
        self._pages[page.number] = page
        self.pages = len(self._pages)
        self._send_access(page)
        self._robot.request_layers(self._wanted)  # makes it send what was held back without a page
        return page

    def leave(self, page: Page) -> None:
        """Releases the page's pad and drops its layers."""
        self._desk.leave(page.number)
        self._pages.pop(page.number, None)
        self.pages = len(self._pages)
        self._look()

    def on_message(self, page: Page, text: str | bytes | None) -> bool:
        """Handles a frame of a page. False: the page is to be closed."""
        now_s = self._now_s()
        staff = self._desk.access.role(page.number, now_s) is Role.STAFF
        try:
            message = p.parse(
                text if isinstance(text, str) else b"", p.STAFF_BYTES_MAX if staff else p.MESSAGE_BYTES_MAX
            )
        except p.Refused as refused:
            page.refused += 1
            self._say(page, {"t": "refused", "id": refused.id, "why": INVALID, "detail": str(refused)})
            return page.refused < REFUSED_MAX
        held_by_staff = self._sections.get("queue", {}).get("held_by") == HeldBy.STAFF.name
        ruling = self._desk.take(page.number, message, now_s, held_by_staff=held_by_staff)
        if ruling.audit:
            self._audit(page, ruling.audit, ruling.why or "ok")
        if ruling.effect is not None:
            self._do(page, ruling.effect, now_s)
        else:
            page.floods += ruling.why == "answer.too_fast"
            self.answer(page.number, message.id, ruling.why == OK, ruling.why)
        return page.floods < _FLOOD_MAX

    def _do(self, page: Page, message: p.ClientMessage, now_s: float) -> None:
        match message:
            case p.Stop():
                self._robot.stop()
                self.answer(page.number, message.id, True)
            case p.Alive():
                page.alive_s = now_s
            case p.Show():
                self._show(page, frozenset(message.layers))
            case p.Ready():
                page.ready.add(message.layer)
                self._look()
            case p.Login():
                self._begin_check(page, message)
            case p.Logout():
                self._send_access(page)
                self._show(page, self._allowed(page))
            case p.Pad() | p.Lift():
                self._begin_driving()
            case _:
                self._robot.carry_out(page.number, message)

    def _show(self, page: Page, layers: frozenset[p.Layer]) -> None:
        for layer in page.layers - layers:
            page.changes.forget(layer.value)
        page.tests_opened += p.Layer.SELF_TEST in layers - page.layers
        page.layers = layers
        page.ready |= layers & frozenset(p.BINARY_LAYERS)
        page.changes.offer({layer.value: self._layers[layer] for layer in layers if layer in self._layers})
        page.something.set()
        self._look()

    def _allowed(self, page: Page) -> frozenset[p.Layer]:
        """The layers of a page that its role permits."""
        staff = self._desk.access.role(page.number, self._now_s()) is Role.STAFF
        return page.layers if staff else page.layers & {p.Layer.PLAN}

    # --- from the node -----------------------------------------------------------------------------------------------

    def push(self, sections: Mapping[str, Any], layers: Mapping[p.Layer, Any]) -> None:
        """Updates the newest values of all sections."""
        self._sections |= sections
        self._layers |= layers
        for page in self._pages.values():
            page.changes.offer(sections)
            allowed = self._allowed(page)
            page.changes.offer({layer.value: value for layer, value in layers.items() if layer in allowed})
            self._send_access(page)
            page.something.set()
        self._look()

    def frame(self, layer: p.Layer, data: bytes) -> None:
        """Passes data to the pages that wait for it; the newest of each layer is kept."""
        for page in self._pages.values():
            if layer in self._allowed(page):
                page.frames[layer] = data
                page.something.set()

    def answer(self, number: int, message_id: int, ok: bool, why: str = "", detail: str = "", **more: Any) -> None:
        page = self._pages.get(number)
        if page is not None and (message_id or not ok):
            self._say(page, {"t": "answer", "id": message_id, "ok": ok, "why": why, "detail": detail[:300], **more})

    def who(self, number: int) -> str:
        page = self._pages.get(number)
        role = self._desk.access.role(number, self._now_s()).value
        return f"page {number} {page.address} {role}" if page else f"page {number} (gone)"

    # --- to the pages ------------------------------------------------------------------------------------------------

    async def send(self, page: Page, text: Callable[[str], Any], data: Callable[[bytes], Any]) -> None:
        """Sends as fast as the page reads, until it is cancelled."""
        while True:
            for item in self._due(page):
                await text(item)
            for layer in [layer for layer in page.frames if layer in page.ready]:
                page.ready.discard(layer)
                await data(page.frames.pop(layer))
                self._look()
            wait_s = min(TICK_S, page.changes.wait_s(self._now_s()))
            try:
                if wait_s > 0.0:
                    page.something.clear()
                    await asyncio.wait_for(self._anything(page, wait_s), wait_s)
            except TimeoutError:
                if wait_s >= TICK_S:
                    await text('{"t":"tick"}')

    async def _anything(self, page: Page, wait_s: float) -> None:
        """Waits for an update that may be sent now: earlier ones wait for their time."""
        while True:
            await page.something.wait()
            page.something.clear()
            urgent = page.answers or any(layer in page.ready for layer in page.frames)
            if urgent or page.changes.wait_s(self._now_s()) < wait_s:
                return

    def _due(self, page: Page) -> list[str]:
        due, page.answers = page.answers, []
        changed = page.changes.take(self._now_s())
        if changed:
            due.append(json.dumps({"t": "state", "v": changed}, allow_nan=False, separators=(",", ":")))
        return due

    def _say(self, page: Page, message: dict[str, Any]) -> None:
        page.answers = [*page.answers[-20:], json.dumps(message)]
        page.something.set()

    def _send_access(self, page: Page) -> None:
        access, now_s = self._desk.access, self._now_s()
        page.changes.offer(
            {
                "access": {
                    "role": access.role(page.number, now_s).value,
                    "pin_set": access.pin_set,
                    "wait_s": 5 * -(-int(access.wait_s(page.number, now_s)) // 5),
                    "expires_s": 30 * -(-int(access.expires_s(page.number, now_s)) // 30),
                    "pad": "free" if self._desk.pad.holder in (None, page.number) else "busy",
                }
            }
        )

    def _look(self) -> None:
        """Updates the shown and awaited layers, the number of pages, and the pages that show the self test."""
        now_s = self._now_s()
        allowed = {number: self._allowed(page) for number, page in self._pages.items()}
        self.awaited = frozenset(layer for page in self._pages.values() for layer in page.ready & allowed[page.number])
        silence_s = self._params.server.page_silence_s
        alive = {number for number, page in self._pages.items() if now_s - page.alive_s <= silence_s}
        self.connected = len(alive)
        testers = [number for number in alive if p.Layer.SELF_TEST in allowed[number]]
        self.testers = {number: self._pages[number].tests_opened for number in testers}
        wanted = frozenset(layer for layers in allowed.values() for layer in layers)
        if wanted != self._wanted:
            self._wanted = wanted
            self._robot.request_layers(wanted)

    # --- slow operations ---------------------------------------------------------------------------------------------

    def _begin_check(self, page: Page, message: p.Login) -> None:
        self._spawn(self._check_pin(page, message))

    async def _check_pin(self, page: Page, message: p.Login) -> None:
        """In a thread, so that it does not delay the stop of another page."""
        right = False
        try:
            right = await asyncio.to_thread(verify_pin, self._params.access.pin_hash, message.pin)
        finally:
            self._end_check(page, message, right)

    def _end_check(self, page: Page, message: p.Login, right: bool) -> None:
        now_s = self._now_s()
        self._desk.access.end_check(page.number, right, now_s)
        if page.number not in self._pages:
            return
        locked = self._desk.access.wait_s(page.number, now_s) > 0.0
        self._audit(page, "staff PIN", "ok" if right else "wrong")
        self._send_access(page)
        self.answer(page.number, message.id, right, OK if right else WAIT if locked else WRONG_PIN)

    def _begin_driving(self) -> None:
        if not self._driving:
            self._driving = True
            self._spawn(self._drive())

    async def _drive(self) -> None:
        """20 Hz while a finger is on the pad, and one standstill after it."""
        try:
            while (twist := self._desk.pad.command(self._now_s())) is not None:
                self._robot.drive(twist)
                await asyncio.sleep(PAD_PERIOD_S)
        finally:
            self._driving = False

    @property
    def driving(self) -> bool:
        return self._driving

    def _spawn(self, work: Any) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _audit(self, page: Page, what: str, outcome: str) -> None:
        self._robot.audit(self.who(page.number), what, outcome)

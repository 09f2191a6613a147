"""The touch screen on the scheduler: pages that speak the touch screen's protocol without a network.

Counterparts of ``robot_stack.ui.nodes.server.WebServer`` and ``robot_stack.ui.nodes.hub.Hub``.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from robot_stack.middleware.port import Port
from robot_stack.ui import protocol as p
from robot_stack.ui.nodes.hub import PAD_PERIOD_S, Hub, Page
from robot_stack.ui.pin import verify_pin
from sim.stack.computer import ADDRESS

_ALIVE_S = 1.0


class ScheduledHub(Hub):
    """Runs the tasks of the hub's loop at once, or by the node's timer."""

    port: Port

    def _begin_check(self, page: Page, message: p.Login) -> None:
        self._end_check(page, message, verify_pin(self._params.access.pin_hash, message.pin))

    def _begin_driving(self) -> None:
        if self._driving:
            return
        self._driving = True

        def step() -> None:
            twist = self._desk.pad.command(self._now_s())
            if twist is None:
                self._driving = False
                timer.destroy()
            else:
                self._robot.drive(twist)

        timer = self.port.add_real_timer(PAD_PERIOD_S, step)

    def changes(self, page: Page) -> dict[str, Any]:
        """The sections that the page receives now."""
        return page.changes.take(self._now_s())


class ScheduledServer:
    """See ``WebServer``. ``open_page`` is what a browser does."""

    url = ADDRESS

    def __init__(self, port: Port, hub: ScheduledHub) -> None:
        self._port, self.hub = port, hub
        self._pages: list[OpenPage] = []

    def alive(self) -> bool:
        return True

    def call(self, function: Callable[..., None], *arguments: Any) -> None:
        function(*arguments)

    def frame(self, layer: p.Layer, data: bytes) -> None:
        self.hub.frame(layer, data)

    def open_page(self, address: str = "127.0.0.1") -> OpenPage:
        page = OpenPage(self._port, self.hub, address)
        self._pages.append(page)
        return page

    def close(self) -> None:
        for page in self._pages:
            page.close()
        self._pages = []


class OpenPage:
    """A page in a browser: sends heartbeats and its user's input. Called from the scheduler, in no loop."""

    def __init__(self, port: Port, hub: ScheduledHub, address: str) -> None:
        self._port, self._hub = port, hub
        self._page: Page | None = None
        self._ids = 0
        self._state: dict[str, Any] = {}
        self._address = address
        port.call_soon(self._join)
        self._timer = port.add_real_timer(_ALIVE_S, lambda: self._send({"t": "alive"}))

    @property
    def answers(self) -> list[str]:
        """The newest answers of the server, as JSON."""
        return [] if self._page is None else list(self._page.answers)

    @property
    def state(self) -> dict[str, Any]:
        """The newest sections that the server has sent."""
        if self._page is not None:
            self._state |= self._hub.changes(self._page)
        return self._state

    def say(self, **message: Any) -> int:
        """Sends a protocol message, e.g. ``say(t="start", mission="short_hop")``. Returns the id of its answer."""
        self._ids += 1
        numbered = {**message, "id": self._ids}
        self._port.call_soon(lambda: self._send(numbered))
        return self._ids

    def silence(self) -> None:
        """Stops the heartbeats, like a page that hangs or is hidden."""
        self._timer.destroy()

    def close(self) -> None:
        self._timer.destroy()
        if self._page is not None:
            self._hub.leave(self._page)
            self._page = None

    def _join(self) -> None:
        self._page = self._hub.join(self._address)
        self._send({"t": "alive"})

    def _send(self, message: dict[str, Any]) -> None:
        if self._page is not None:
            self._hub.on_message(self._page, json.dumps(message))

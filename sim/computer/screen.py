"""The browser on the robot's own screen, a client of the real touch_ui: a WebSocket with heartbeats."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable
from urllib.parse import urlsplit

from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

# After this many of the screen's heartbeats a page counts as seen by the monitors of the link.
_SEEN = 2
_JOIN_S = 5.0


class Screen:
    """No page at first. address: where touch_ui serves, None while it does not.

    ``show`` and ``lose`` return at once; a thread carries out the change.
    """

    def __init__(self, address: Callable[[], str | None], period_s: float) -> None:
        self._address, self._period_s = address, period_s
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        self._heartbeats, self._lost = 0, False

    @property
    def shown(self) -> bool:
        return self._thread is not None

    def show(self) -> None:
        """Opens a page, which reconnects after a loss of the server."""
        self._lost = False
        if self._thread is None:
            self._ended, self._heartbeats = threading.Event(), 0
            self._thread = threading.Thread(target=self._run, args=(self._ended,), name="screen", daemon=True)
            self._thread.start()

    def lose(self) -> None:
        """Closes the page; without one, opens it until it has been seen, after which the link is monitored."""
        self.show()
        self._lost = True
        self._look()

    def on_heartbeat(self) -> None:
        """A heartbeat of touch_ui."""
        self._heartbeats += 1
        self._look()

    def close(self) -> None:
        thread = self._leave()
        if thread is not None:
            thread.join(_JOIN_S)

    def _look(self) -> None:
        if self._lost and self._heartbeats >= _SEEN:
            self._leave()

    def _leave(self) -> threading.Thread | None:
        self._ended.set()
        thread, self._thread = self._thread, None
        return thread

    def _run(self, ended: threading.Event) -> None:
        while not ended.is_set():
            url = self._address()
            if url is not None:
                with contextlib.suppress(OSError, WebSocketException, TimeoutError), _page(url) as socket:
                    self._live(socket, ended)
            ended.wait(self._period_s)

    def _live(self, socket: ClientConnection, ended: threading.Event) -> None:
        """Receives the data that the page would draw."""
        spoken_s = -math.inf
        while not ended.is_set():
            now_s = time.monotonic()
            if now_s - spoken_s >= self._period_s:
                spoken_s = now_s
                socket.send('{"t": "alive"}')
            with contextlib.suppress(TimeoutError):
                socket.recv(timeout=self._period_s)


def _page(url: str) -> ClientConnection:
    place = urlsplit(url)
    scheme = "wss" if place.scheme == "https" else "ws"
    return connect(f"{scheme}://{place.netloc}/ws", origin=Origin(f"{place.scheme}://{place.netloc}"), compression=None)

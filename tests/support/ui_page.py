"""A touch screen page without a browser: a real WebSocket client that records what it receives."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from tests.support.waiting import wait_for

PIN = "2468"


class WebPage:
    """state: the received sections. frames: binary frames by their first byte. alive: sends a heartbeat at 2 Hz."""

    def __init__(self, port: int, *, origin: str | None = None, alive: bool = True) -> None:
        own = f"http://127.0.0.1:{port}"
        self.socket: ClientConnection = connect(
            f"ws://127.0.0.1:{port}/ws", origin=origin or own, compression=None, open_timeout=20, legacy=True
        )
        self.state: dict[str, Any] = {}
        self.reported: list[tuple[float, dict[str, Any]]] = []
        self.answers: dict[int, dict[str, Any]] = {}
        self.refused: list[str] = []
        self.frames: dict[int, list[bytes]] = {}
        self.closed: int | None = None
        self._ids = 0
        self._done = threading.Event()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self._beater = threading.Thread(target=self._beat, daemon=True)
        if alive:
            self._beater.start()

    def say(self, t: str, **fields: Any) -> int:
        """Sends a message and returns its number, which the answer contains."""
        self._ids += 1
        self.send(json.dumps({"t": t, "id": self._ids, **fields}))
        return self._ids

    def send(self, data: str | bytes) -> None:
        self.socket.send(data)

    def ask(self, t: str, **fields: Any) -> dict[str, Any]:
        number = self.say(t, **fields)
        return dict(wait_for(lambda: self.answers.get(number), f"an answer to {t}"))

    def log_in(self, pin: str = PIN) -> WebPage:
        assert self.ask("login", pin=pin)["ok"]
        return self

    def wait(self, section: str, key: str, value: Any, deadline_s: float = 45.0) -> None:
        wait_for(
            lambda: self.state.get(section, {}).get(key) == value,
            f"{section}.{key} to be {value!r}, is {self.state.get(section)}",
            deadline_s,
        )

    def _read(self) -> None:
        try:
            for item in self.socket:
                self._take(item)
        except ConnectionClosed:
            pass
        self.closed = self.socket.close_code

    def _take(self, item: str | bytes) -> None:
        if isinstance(item, bytes):
            self.frames.setdefault(item[0], []).append(item)
            return
        message = json.loads(item)
        match message["t"]:
            case "state":
                self.reported.append((time.monotonic(), message["v"]))
                self.state |= message["v"]
            case "answer":
                self.answers[message["id"]] = message
            case "refused":
                self.refused.append(message["detail"])

    def _beat(self) -> None:
        with suppress(ConnectionClosed):
            while not self._done.wait(0.5):
                self.send('{"t": "alive"}')

    def close(self) -> None:
        self._done.set()
        self.socket.close()
        self._reader.join(5.0)


@contextmanager
def web_page(port: int, **options: Any) -> Iterator[WebPage]:
    page = WebPage(port, **options)
    try:
        yield page
    finally:
        page.close()

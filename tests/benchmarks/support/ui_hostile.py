"""Requests no page of ours sends: wrong methods, paths, hosts, tokens and bodies, broken WebSockets and messages."""

from __future__ import annotations

import json
import random
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, field

from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from tests.benchmarks.support.ui_garbage import frames, requests, torn_frames, wrong_handshakes

_TIMEOUT_S = 20.0
_SERVER_ERROR, _OK, _SWITCHING = 500, 200, 101
# One more refused message closes a page.
_A_SOCKET = 19
_A_PIECE = 65_536


@dataclass(frozen=True, slots=True)
class Target:
    """place: host:port. cookie: of a valid page; empty if the server requires none."""

    place: str
    cookie: str

    @property
    def origin(self) -> str:
        return f"http://{self.place}"


@dataclass(slots=True)
class Outcome:
    """answers_ms: until a request was answered or its connection ended. unanswered: neither happened within 20 s.

    errors: answers of 500 and above. accepted: hostile requests that were executed.
    """

    answers_ms: list[float] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    accepted: list[str] = field(default_factory=list)
    unanswered: list[str] = field(default_factory=list)

    @property
    def tried(self) -> int:
        return len(self.answers_ms) + len(self.unanswered)

    def note(self, what: str, begun_s: float, status: int) -> None:
        """status: of HTTP; 0: the connection was ended without one."""
        self.answers_ms.append(1e3 * (time.monotonic() - begun_s))
        if status >= _SERVER_ERROR:
            self.errors.append(f"{status} for {what}")
        elif status in (_OK, _SWITCHING):
            self.accepted.append(f"{status} for {what}")


def attack(target: Target, count: int, seed: int) -> Outcome:
    """At least ``count`` requests, the same for the same seed."""
    outcome, draw = Outcome(), random.Random(seed)
    kinds: tuple[Callable[[Target, random.Random, Outcome], None], ...]
    kinds = (_messages, _http, _http, _http, _http, _handshake, _handshake, _torn)
    while outcome.tried < count:
        for kind in kinds:
            kind(target, draw, outcome)
    return outcome


def _http(target: Target, draw: random.Random, outcome: Outcome) -> None:
    data = requests(draw, target.place, target.cookie)
    _exchange(target, data, outcome)


def _handshake(target: Target, draw: random.Random, outcome: Outcome) -> None:
    _exchange(target, wrong_handshakes(draw, target.place, target.cookie), outcome)


def _exchange(target: Target, data: bytes, outcome: Outcome) -> None:
    begun_s, what = time.monotonic(), repr(data[:120])
    try:
        with closing(_connection(target)) as connection:
            _send(connection, data)
            outcome.note(what, begun_s, _status(_answer(connection)))
    except TimeoutError:
        outcome.unanswered.append(what)


def _connection(target: Target) -> socket.socket:
    host, _, port = target.place.rpartition(":")
    return socket.create_connection((host, int(port)), _TIMEOUT_S)


def _send(connection: socket.socket, data: bytes) -> None:
    """Sends until the server closes: it may answer and close before the end."""
    with suppress(BrokenPipeError, ConnectionResetError):
        connection.sendall(data)


def _answer(connection: socket.socket) -> bytes:
    """The head of the answer; empty if the connection ends without one. Raises TimeoutError."""
    answer = b""
    with suppress(ConnectionResetError):
        while b"\r\n" not in answer and (piece := connection.recv(_A_PIECE)):
            answer += piece
    return answer


def _status(answer: bytes) -> int:
    words = answer.split(b" ", 2)
    return int(words[1]) if len(words) > 1 and words[0].startswith(b"HTTP/") and words[1].isdigit() else 0


# --- accepted WebSockets: riders' pages that send invalid messages ----------------------------------------------------


def _page(target: Target) -> ClientConnection:
    return connect(
        f"ws://{target.place}/ws",
        origin=Origin(target.origin),
        additional_headers={"Cookie": target.cookie} if target.cookie else None,
        compression=None,
        open_timeout=_TIMEOUT_S,
    )


def _messages(target: Target, draw: random.Random, outcome: Outcome) -> None:
    """Each is answered before the next one is sent."""
    with suppress(ConnectionClosed, InvalidHandshake), _page(target) as page:
        for _, frame in zip(range(_A_SOCKET), frames(draw), strict=False):
            begun_s, what = time.monotonic(), repr(frame[:120])
            try:
                page.send(frame)
                obeyed = _obeyed(page)
            except ConnectionClosed:
                outcome.note(what, begun_s, 0)
                raise
            except TimeoutError:
                outcome.unanswered.append(what)
                return
            outcome.note(what, begun_s, _OK if obeyed else 0)


def _obeyed(page: ClientConnection) -> bool:
    """True if the page's last message was accepted. Raises TimeoutError."""
    for reported in _reported(page):
        if reported.get("t") == "refused":
            return False
        if reported.get("t") == "answer":
            return bool(reported.get("ok"))
    return False


def _reported(page: ClientConnection) -> Iterator[dict[str, object]]:
    end_s = time.monotonic() + _TIMEOUT_S
    while True:
        item = page.recv(timeout=end_s - time.monotonic())
        if isinstance(item, str):
            yield json.loads(item)


def _torn(target: Target, draw: random.Random, outcome: Outcome) -> None:
    """Invalid WebSocket frames after a valid handshake."""
    begun_s, data = time.monotonic(), torn_frames(draw)
    what = f"a WebSocket with {data[:40]!r}"
    try:
        with closing(_connection(target)) as connection:
            _send(connection, _handshake_bytes(target))
            if _status(_answer(connection)) != _SWITCHING:
                outcome.errors.append("no WebSocket for a page of ours")
                return
            begun_s = time.monotonic()
            _send(connection, data)
            _until_closed(connection, begun_s + _TIMEOUT_S)
            outcome.note(what, begun_s, 0)
    except (TimeoutError, InvalidStatus):
        outcome.unanswered.append(what)


def _handshake_bytes(target: Target) -> bytes:
    cookie = f"Cookie: {target.cookie}\r\n" if target.cookie else ""
    return (
        f"GET /ws HTTP/1.1\r\nHost: {target.place}\r\nOrigin: {target.origin}\r\n{cookie}Upgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    ).encode()


def _until_closed(connection: socket.socket, end_s: float) -> None:
    """Reads until the server closes. Raises TimeoutError."""
    with suppress(ConnectionResetError):
        while connection.recv(_A_PIECE):
            if time.monotonic() > end_s:
                raise TimeoutError

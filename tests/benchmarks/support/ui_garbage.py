"""Hostile input for the touch screen's server, drawn from a seeded generator. Nothing here is what a page may say."""

from __future__ import annotations

import json
import random
import struct
from collections.abc import Iterator

from robot_stack.ui import protocol as p

# Staff requests from a page without the PIN, wrong PINs, and invalid messages.
_FORBIDDEN: tuple[dict[str, object], ...] = (
    {"t": "reset", "id": 1},
    {"t": "pad", "x": 1.0, "y": 0.0, "turn": 0.5, "at_ms": 1.0},
    {"t": "pose", "x": 1.0, "y": 2.0, "yaw": 0.5},
    {"t": "goal", "x": 1.0, "y": 2.0, "yaw": 0.5, "id": 7},
    {"t": "cancel_goal"},
    {"t": "login", "pin": "0000"},
    {"t": "login", "pin": "' OR 1=1 --"},
    {"t": "show", "layers": ["costmap", "../../etc"]},
    {"t": "start", "mission": "../../etc/passwd"},
    {"t": "start", "mission": ["site_ride"]},
    {"t": "stop", "id": -1},
    {"t": "STOP"},
    {"t": ["stop"]},
    {"t": "goal", "x": "1", "y": True, "yaw": None},
    {"__proto__": {"t": "stop"}},
)
_WORDS = (
    "NaN",
    '{"t":"goal","x":NaN,"y":0,"yaw":0}',
    '{"t":"goal","x":1e400,"y":-Infinity,"yaw":0}',
    '{"t":"pad","x":0,"y":0,"turn":0,"at_ms":-1}',
    '{"t":"stop","id":99999999999999999999999999}',
    '{"t":"stop","t":"reset","id":1}',
    "[" * 2000,
    '{"t":' * 500 + "1" + "}" * 500,
    '"\\ud800"',
    "",
    "null",
    "\x00",
    "[]",
    '{"t":"call","on":"yes"}',
    " " * 4097,
    "x" * 100_000,
)
_METHODS = ("POST", "PUT", "DELETE", "PATCH", "TRACE", "OPTIONS", "CONNECT", "PROPFIND", "get", "G\x00T", "A" * 300)
_PATHS = (
    "/../config/touch_ui.yaml",
    "/..%2f..%2fconfig/touch_ui.yaml",
    "/%2e%2e/params.py",
    "//etc/passwd",
    "/vendor/../../nodes/hub.py",
    "/vendor/%2e%2e/%2e%2e/nodes/hub.py",
    "/..\\..\\config",
    "/%00",
    "/index.html%00.js",
    "/ws/..",
    "/%ff%fe",
    "/" + "a/" * 2000,
    "/file:///etc/passwd",
    "/app.js/../../params.py",
    "/.git/config",
)
_FOREIGN = (
    "http://evil.example",
    "null",
    "https://127.0.0.1",
    "http://127.0.0.1:1",
    "",
    "http://127.0.0.1.evil.example",
)
_HOSTS = ("evil.example", "", "127.0.0.1", "127.0.0.1:1", "localhost@evil.example", "[::1", "a" * 500)
_HUGE = 2_000_000


def frames(draw: random.Random) -> Iterator[str | bytes]:
    """An endless stream of messages."""
    while True:
        frame = _frame(draw)
        if not _allowed(frame):
            yield frame


def _frame(draw: random.Random) -> str | bytes:
    if draw.random() < 0.2:
        return draw.choice(_WORDS)
    text = bytearray(json.dumps(draw.choice(_FORBIDDEN)).encode())
    if draw.random() < 0.3:
        return text.decode()
    for _ in range(draw.randint(1, 5)):
        at = draw.randrange(len(text) + 1)
        if draw.random() < 0.5:
            text[at:at] = draw.choice((b'"', b"{", b"\x00", b"e99999", b"NaN", b"\xf0\x9f", b"," * 50))
        else:
            del text[at : at + draw.randint(1, 6)]
    return bytes(text) if draw.random() < 0.2 else text.decode("utf-8", "replace")


def _allowed(frame: str | bytes) -> bool:
    """True if a mutated message is one that every page may send, e.g. a stop with another number."""
    try:
        message = p.parse(frame if isinstance(frame, str) else b"")
    except p.Refused:
        return False
    staff = (p.Reset, p.Pad, p.Pose, p.Goal, p.CancelGoal, p.Login)
    return not isinstance(message, staff)


def requests(draw: random.Random, place: str, cookie: str) -> bytes:
    """An HTTP request, or bytes that resemble one."""
    match draw.randrange(7):
        case 0:
            return _request(draw.choice(_METHODS), draw.choice(("/", "/ws", "/app.js", "*")), place, cookie)
        case 1:
            return _request("GET", draw.choice(_PATHS), place, cookie)
        case 2:
            return _request("GET", "/", draw.choice(_HOSTS), cookie)
        case 3:
            body = draw.randbytes(draw.choice((10, 5_000, _HUGE)))
            length = draw.choice((len(body), 10**15, -1, 0))
            return _request("POST", "/", place, cookie, f"Content-Length: {length}\r\n", body)
        case 4:
            chunked = f"Transfer-Encoding: {draw.choice(('chunked', 'chunked, chunked', 'gzip'))}\r\n"
            return _request("POST", "/ws", place, cookie, chunked, b"zz\r\n" + draw.randbytes(100))
        case 5:
            return _request("GET", "/", place, _wrong_token(draw, cookie), f"X: {'a' * draw.choice((10, 100_000))}\r\n")
        case _:
            return draw.randbytes(draw.randint(1, 200)) + b"\r\n\r\n"


def _wrong_token(draw: random.Random, cookie: str) -> str:
    """Shorter, longer, another, none at all, or the right one under a foreign name."""
    name, _, token = cookie.partition("=")
    if draw.random() < 0.02:  # rarely: the server holds such a connection until its timeout
        return f"{name}=\x01"
    wrong = (token[:-1], token + "x", token.swapcase(), "", "é" * 40, draw.randbytes(20).hex())
    return f"x{cookie}" if draw.random() < 0.1 else f"{name}={draw.choice(wrong)}"


def _request(method: str, path: str, host: str, cookie: str, more: str = "", body: bytes = b"") -> bytes:
    head = f"{method} {path} HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\nConnection: close\r\n{more}\r\n"
    return head.encode("utf-8") + body


def wrong_handshakes(draw: random.Random, place: str, cookie: str) -> bytes:
    """A WebSocket from a foreign page, to a foreign host, with a wrong token, or with a broken handshake."""
    origin, host, version, key = f"http://{place}", place, "13", "MDEyMzQ1Njc4OWFiY2RlZg=="
    match draw.randrange(5):
        case 0:
            origin = draw.choice(_FOREIGN)
        case 1:
            host = draw.choice(_HOSTS)
        case 2:
            cookie = _wrong_token(draw, cookie)
        case 3:
            version = draw.choice(("0", "99", "x"))
        case _:
            key = draw.choice(("", "x", "A" * 5000))
    more = f"Origin: {origin}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: {version}\r\n"
    head = f"GET /ws HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\n{more}Sec-WebSocket-Key: {key}\r\n\r\n"
    return head.encode("utf-8")


def torn_frames(draw: random.Random) -> bytes:
    """Frames that end a WebSocket: each is a protocol error of RFC 6455."""
    mask = b"\x01\x02\x03\x04"
    kinds = (
        b"\x81\x05hello",  # not masked
        b"\xf1\x85" + mask + b"hello",  # reserved bits
        b"\x83\x85" + mask + b"hello",  # a reserved opcode
        b"\x81\xff" + struct.pack(">Q", 2**62) + mask,  # longer than any memory
        b"\x81\xfe" + struct.pack(">H", 60_000) + mask + b"x" * 60_000,  # longer than the limit of a message
        b"\x89\xfe" + struct.pack(">H", 1000) + mask + b"x" * 1000,  # a ping longer than its limit
        b"\x09\x85" + mask + b"hello",  # a ping in pieces
        b"\x80\x85" + mask + b"hello",  # a continuation without a beginning
        b"\x81\x82" + mask + bytes((0xFF ^ 1, 0xFE ^ 2)),  # text that is not UTF-8
        b"\x88\x81" + mask + b"x",  # a close frame with half a code
    )
    return draw.choice(kinds)

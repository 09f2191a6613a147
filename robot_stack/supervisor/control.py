"""The control socket: one JSON line as request, one JSON line as response.

    {"verb": "status"}                     -> the state of every process
    {"verb": "restart", "process": NAME}   -> {"ok": true}
    {"verb": "down"}                       -> response once everything has stopped

It lies in the runtime folder, which only its user may enter.
"""

from __future__ import annotations

import contextlib
import json
import selectors
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

from robot_stack.core.runtime import runtime_dir

SOCKET_NAME = "supervisor.sock"
_LONGEST_REQUEST = 65536


class NotRunning(Exception):
    """No supervisor answers in this ROS domain."""


def socket_path() -> Path:
    return runtime_dir() / SOCKET_NAME


def ask(verb: str, timeout_s: float = 5.0, **arguments: Any) -> dict[str, Any]:
    """The supervisor's answer. Raises NotRunning if there is none, TimeoutError if it stays silent."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.settimeout(timeout_s)
        try:
            connection.connect(str(socket_path()))
            connection.sendall(json.dumps({"verb": verb, **arguments}).encode() + b"\n")
            line = connection.makefile("rb").readline()
        except TimeoutError:
            raise
        except OSError as error:
            raise NotRunning(f"no supervisor at {socket_path()}") from error
    if not line:
        raise NotRunning("the supervisor ended before it answered")
    answer: dict[str, Any] = json.loads(line)
    return answer


class ControlServer:
    """Serves the socket from the supervisor's own loop, so that a hung supervisor does not answer either.

    handle(request, reply): called for each request; ``reply`` may be called later.
    """

    def __init__(self, selector: selectors.BaseSelector, handle: Callable[[dict[str, Any], Reply], None]) -> None:
        self._selector = selector
        self._handle = handle
        self._path = socket_path()
        with contextlib.suppress(FileNotFoundError):
            self._path.unlink()  # of a killed supervisor: this process holds the lock, so the socket is unused
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(str(self._path))
        self._path.chmod(0o600)
        self._listener.listen(16)
        self._listener.setblocking(False)
        selector.register(self._listener, selectors.EVENT_READ, self._accept)

    def close(self) -> None:
        self._selector.unregister(self._listener)
        self._listener.close()
        with contextlib.suppress(FileNotFoundError):
            self._path.unlink()

    def _accept(self) -> None:
        try:
            connection, _ = self._listener.accept()
        except OSError:  # the client has disconnected
            return
        connection.setblocking(False)
        received = bytearray()
        self._selector.register(connection, selectors.EVENT_READ, lambda: self._read(connection, received))

    def _read(self, connection: socket.socket, received: bytearray) -> None:
        try:
            chunk = connection.recv(4096)
        except BlockingIOError:
            return
        except OSError:
            chunk = b""
        received += chunk
        if chunk and b"\n" not in received and len(received) <= _LONGEST_REQUEST:
            return
        self._selector.unregister(connection)
        reply = Reply(connection)
        try:
            request = json.loads(bytes(received).partition(b"\n")[0])
            if not isinstance(request, dict):
                raise ValueError("a request is a JSON object")
        except ValueError as error:
            reply({"ok": False, "error": f"not a request: {error}"})
            return
        self._handle(request, reply)


class Reply:
    """Answers one request, once."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection

    def __call__(self, answer: dict[str, Any]) -> None:
        # Small answers fit the socket's buffer; a client that does not read must not block the supervisor.
        with contextlib.suppress(OSError):
            self._connection.settimeout(0.2)
            self._connection.sendall(json.dumps(answer).encode() + b"\n")
        self._connection.close()

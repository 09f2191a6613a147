"""A client's connection to the engine: calls over the socket, status from shared memory. Calls have timeouts."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from pathlib import Path
from typing import Any, Final

from robot_stack.wmx.api.errors import ErrorCode
from robot_stack.wmx.axes import AxisFeedback, StatusSnapshot, empty_snapshot
from robot_stack.wmx.simulated.protocol import SOCKET_FILE, Decoder, FrameError, encode
from robot_stack.wmx.simulated.status_memory import StatusReader, StatusUnreadable

_RECEIVE_BYTES: Final = 65536

Reply = tuple[int, list[Any]]


class Channel:
    """Calls from one process to the engine in ``folder``; one call at a time, each within ``timeout_s``.

    Raises OSError if no engine listens there.
    """

    def __init__(self, folder: Path, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._calls = threading.Lock()
        self._number = 0
        self._decoder = Decoder()
        self._socket: socket.socket | None = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.settimeout(timeout_s)
            self._socket.connect(str(folder / SOCKET_FILE))
        except OSError:
            self._socket.close()
            raise

    @property
    def alive(self) -> bool:
        """True if the connection was open at the last call."""
        return self._socket is not None

    def call(self, method: str, *arguments: Any) -> Reply:
        """(code, values) of the engine's answer; a code of its own if there is none."""
        with self._calls:
            if self._socket is None:
                return ErrorCode.IMLibIsNotRunning, []
            self._number += 1
            try:
                frame = encode([self._number, method, *arguments])
            except FrameError:
                return ErrorCode.ArgumentOutOfRange, []
            try:
                return self._exchange(self._socket, frame)
            except TimeoutError:
                return ErrorCode.APIChannelTimeOut, []
            except (OSError, FrameError):
                self._close()
                return ErrorCode.IMLibIsNotRunning, []

    def close(self) -> None:
        """Ends the connection; without a preceding CloseDevice the engine treats this as a crashed client."""
        with self._calls:
            self._close()

    def _close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _exchange(self, connection: socket.socket, frame: bytes) -> Reply:
        deadline = time.monotonic() + self._timeout_s
        connection.settimeout(self._timeout_s)
        connection.sendall(frame)
        while True:
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise TimeoutError
            connection.settimeout(left)
            data = connection.recv(_RECEIVE_BYTES)
            if not data:
                raise ConnectionResetError
            for number, code, *values in self._decoder.feed(data):
                if number == self._number:  # else a late answer to a call that was given up
                    return code, values


class StatusView:
    """The engine's status for one client: with a limit on its age, remapped when another engine took over."""

    def __init__(self, folder: Path, stale_s: float) -> None:
        self._folder = folder
        self._stale_s = stale_s
        self._stale_ns = round(1e9 * stale_s)
        self._reader: StatusReader | None = None
        self._last = empty_snapshot()

    def read(self) -> tuple[int, StatusSnapshot]:
        """(code, snapshot): StatusChannelNull without a page, StatusChannelError for one that is stale.

        While a writer is held up in the middle of a write, the snapshot before is returned, until it is stale, too. A
        stale snapshot is returned as the last known state; it must not be used for the present.
        """
        code, snapshot = self._try()
        if code and self._reader is not None and self._reader.replaced():
            self._reader = None
            code, snapshot = self._try()
        return code, snapshot

    def read_feedback(self) -> AxisFeedback | None:
        """None if ``read`` returns an error code, or has to map another page first."""
        if self._reader is None:
            return None
        try:
            feedback = self._reader.read_feedback()
        except StatusUnreadable:
            return None
        return feedback if time.monotonic_ns() - feedback.stamp_ns <= self._stale_ns else None

    def _try(self) -> tuple[int, StatusSnapshot]:
        try:
            if self._reader is None:
                self._reader, self._last = StatusReader(self._folder), empty_snapshot()
        except StatusUnreadable:
            return ErrorCode.StatusChannelNull, empty_snapshot()
        with contextlib.suppress(StatusUnreadable):
            self._last = self._reader.read()
        stale = self._last.age_s(time.monotonic_ns()) > self._stale_s
        return (ErrorCode.StatusChannelError if stale else ErrorCode.PyNone), self._last

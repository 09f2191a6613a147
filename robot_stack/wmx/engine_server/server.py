"""The engine process for its clients: a local socket for commands, shared memory for status, one thread for all.

``cycle`` is one complete cycle, for a caller that sets the pace; ``serve_forever`` paces it by the clock. No
client can block or end a cycle: sockets do not block, and a client that sends invalid data or does not read
its answers is disconnected. A device outlives its connection until its watchdog expires.
"""

from __future__ import annotations

import contextlib
import fcntl
import select
import socket
import struct
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, Final

from robot_stack.core.pacing import Pacer, Sleeper, sharpen_sleep
from robot_stack.core.runtime import AlreadyRunning
from robot_stack.wmx.api.errors import ErrorCode
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.requests import Answer, Session, execute
from robot_stack.wmx.engine_server.status_writer import StatusWriter
from robot_stack.wmx.simulated.protocol import SOCKET_FILE, Decoder, FrameError, encode

LOCK_FILE: Final = "engine.lock"

_RECEIVE_BYTES: Final = 16384
"""Of one client between two cycles: splitting it into requests takes well under a millisecond."""
_REQUESTS_PER_TURN: Final = 32
"""Requests of one client carried out between two cycles; the rest waits, so that no client starves the cycle."""
_UNREAD_BYTES: Final = 1 << 20
"""Answers a client may leave unread before it is cut off."""
_LONGEST_SOCKET_PATH: Final = 107


class _Client:
    """One connection."""

    def __init__(self, connection: socket.socket) -> None:
        self.socket = connection
        self.pid = _peer_pid(connection)
        self.session = Session()
        self.decoder = Decoder()
        self.requests: deque[list[Any]] = deque()
        self.answers = bytearray()
        self.waits_to_send = False
        self.creating: tuple[int, Any] | None = None
        """A request to create a device that is being carried out: its number and its argument."""


class EngineServer:
    """Serves ``engine`` in ``runtime_dir``. Raises AlreadyRunning if another process does, OSError if it cannot.

    ``clock_ns`` is the monotonic clock that stamps the status.
    """

    def __init__(self, engine: Engine, runtime_dir: Path, clock_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self.engine = engine
        self._clock_ns = clock_ns
        self._path = runtime_dir / SOCKET_FILE
        runtime_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._lock = _hold(runtime_dir / LOCK_FILE)
        engine.alive = self._alive
        engine.condition.epoch = clock_ns()  # invalidates the devices of earlier processes
        self._status = StatusWriter(engine, runtime_dir)
        self._listener = _listen(self._path)
        self._poll = select.epoll()
        self._poll.register(self._listener, select.EPOLLIN)
        self._listening = self._listener.fileno()
        self._clients: dict[int, _Client] = {}
        self._busy: set[int] = set()
        self._lock_until_ns = 0
        self._close_lock_until_ns = 0
        self._creator: int | None = None
        self._published_ns = 0
        self._served = False
        self.due_ns = 0
        """When the present cycle was due by the monotonic clock, while ``serve_forever`` sets the pace."""
        self._publish()

    # -- one turn ------------------------------------------------------------------------------------------------------

    def cycle(self) -> None:
        """Serves clients, runs one engine cycle, publishes the status, sends the answers."""
        self.begin()
        self.engine.cycle()
        self.end()

    def begin(self) -> None:
        """Serves clients, before one or more cycles of the engine."""
        self._served = self._serve()

    def end(self) -> None:
        """Publishes the status after the cycles, and sends the answers."""
        self._publish()
        if self._served:
            self._answer()

    def poll(self) -> None:
        """Serves clients without a cycle, for a paused world; keeps the status fresh."""
        served = self._serve()
        if served or self._clock_ns() - self._published_ns > 1e9 * self.engine.config.server.pause_publish_s:
            self._publish()
        if served:
            self._answer()

    def serve_forever(self, stop: Callable[[], bool], speed: float = 1.0) -> None:
        """Cycles on absolute deadlines until ``stop()``; missed cycles are skipped and counted."""
        sharpen_sleep()
        config, condition = self.engine.config, self.engine.condition
        pacer = Pacer(round(1e9 * config.cycle_time_s / speed), Sleeper(config.server.spin))
        skipped_before = condition.overruns
        while not stop():
            self.due_ns = pacer.due_ns
            self.cycle()
            pacer.wait()
            condition.overruns = skipped_before + pacer.missed

    def shut_down(self) -> None:
        """Stops all axes at their quick-stop deceleration, paced by the clock, then the engine. For an orderly end."""
        for axis in range(self.engine.arrays.n_axes):
            self.engine.motion.quick_stop_axis(axis)
        deadline_ns = time.monotonic_ns() + round(1e9 * self.engine.config.server.shutdown_stop_s)
        self.serve_forever(lambda: self.engine.at_rest or time.monotonic_ns() > deadline_ns)
        self.engine.stop_engine()
        self.close()

    def close(self) -> None:
        """Removes socket and lock. Clients lose the engine."""
        self._publish()
        for descriptor in list(self._clients):
            self._clients.pop(descriptor).socket.close()
        self._listener.close()
        self._poll.close()
        self._path.unlink(missing_ok=True)
        self._lock.close()

    @property
    def creating(self) -> bool:
        """A device is being created at this moment."""
        return self._creator is not None

    def inject_close_lock(self, duration_s: float) -> None:
        """Rejects closing of devices for ``duration_s``, as during other closings. For tests."""
        self._close_lock_until_ns = self._clock_ns() + round(1e9 * duration_s)

    def inject_create_lock(self, duration_s: float) -> None:
        """Makes device creation fail with the lock error for a while, as during another process's creation."""
        self._lock_until_ns = self._clock_ns() + round(1e9 * duration_s)

    # -- clients -------------------------------------------------------------------------------------------------------

    def _publish(self) -> None:
        self._published_ns = self._clock_ns()
        self._status.publish(self._published_ns)

    def _serve(self) -> bool:
        events = self._poll.poll(0)
        if not events and not self._busy and self._creator is None:
            return False
        for descriptor, event in events:
            if descriptor == self._listening:
                self._accept()
            elif event & (select.EPOLLIN | select.EPOLLHUP | select.EPOLLERR):
                self._receive(descriptor)
        self._finish_creation()
        for descriptor in sorted(self._busy):
            self._work(descriptor)
        return True

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:  # no pending connection, or closed again
                return
            if len(self._clients) >= self.engine.config.server.max_clients:
                connection.close()
                continue
            connection.setblocking(False)
            self._clients[connection.fileno()] = _Client(connection)
            self._poll.register(connection, select.EPOLLIN)

    def _receive(self, descriptor: int) -> None:
        client = self._clients.get(descriptor)
        if client is None or len(client.requests) > _REQUESTS_PER_TURN:
            return  # further requests of a flood wait in the socket
        try:
            data = client.socket.recv(_RECEIVE_BYTES)
            client.requests.extend(client.decoder.feed(data))
        except BlockingIOError:
            return
        except (OSError, FrameError):
            self._drop(descriptor)
            return
        if not data:
            self._drop(descriptor)
        elif client.requests:
            self._busy.add(descriptor)

    def _work(self, descriptor: int) -> None:
        client = self._clients[descriptor]
        for _ in range(_REQUESTS_PER_TURN):
            if not client.requests or client.creating is not None:
                break
            number, method, *arguments = client.requests.popleft()
            if method == "CreateDevice" and not client.session.device:
                self._begin_creation(descriptor, client, number, arguments)
            elif method == "CloseDevice" and self._clock_ns() < self._close_lock_until_ns:
                self._put(client, number, (ErrorCode.CloseDeviceLockError, []))
            else:
                self._put(client, number, execute(self.engine, client.session, method, arguments))
        if not client.requests:
            self._busy.discard(descriptor)

    def _begin_creation(self, descriptor: int, client: _Client, number: int, arguments: list[Any]) -> None:
        """Starts the creation of a device, which takes a while; other clients get an error meanwhile."""
        now_ns = self._clock_ns()
        if self._creator is not None or now_ns < self._lock_until_ns:
            self._put(client, number, (ErrorCode.CreateDeviceLockError, []))
            return
        client.creating = (number, arguments)
        self._creator = descriptor
        self._lock_until_ns = now_ns + round(1e9 * self.engine.config.server.create_device_s)

    def _finish_creation(self) -> None:
        if self._creator is None or self._clock_ns() < self._lock_until_ns:
            return
        client = self._clients[self._creator]
        assert client.creating is not None
        number, arguments = client.creating
        client.creating = None
        self._put(client, number, execute(self.engine, client.session, "CreateDevice", arguments))
        if client.requests:
            self._busy.add(self._creator)
        self._creator = None

    @staticmethod
    def _put(client: _Client, number: int, answer: Answer) -> None:
        code, values = answer
        try:
            client.answers += encode([number, int(code), *values])
        except FrameError:  # an answer that is too long is an error for its client only
            client.answers += encode([number, int(ErrorCode.SystemError)])

    def _answer(self) -> None:
        for descriptor in [key for key, client in self._clients.items() if client.answers]:
            self._send(descriptor)

    def _send(self, descriptor: int) -> None:
        client = self._clients[descriptor]
        try:
            sent = client.socket.send(client.answers)
        except BlockingIOError:
            sent = 0
        except OSError:
            self._drop(descriptor)
            return
        del client.answers[:sent]
        if len(client.answers) > _UNREAD_BYTES:
            self._drop(descriptor)
            return
        if bool(client.answers) != client.waits_to_send:
            client.waits_to_send = not client.waits_to_send
            self._poll.modify(descriptor, select.EPOLLIN | (select.EPOLLOUT if client.waits_to_send else 0))

    def _drop(self, descriptor: int) -> None:
        """Drops a client that is gone or invalid. Its device gets no more reports."""
        client = self._clients.pop(descriptor)
        self._busy.discard(descriptor)
        if self._creator == descriptor:
            self._creator = None
        with contextlib.suppress(OSError):
            self._poll.unregister(descriptor)
        client.socket.close()

    def _alive(self, device: int) -> bool:
        """Stands for the vendor's library thread in the client's process: it reports as long as that process runs."""
        return any(client.session.device == device and _runs(client.pid) for client in self._clients.values())


def _peer_pid(connection: socket.socket) -> int:
    size = struct.calcsize("3i")
    pid: int = struct.unpack("3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size))[0]
    return pid


def _runs(pid: int) -> bool:
    """The process exists and is not stopped."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_bytes()
    except OSError:
        return False
    return stat.rpartition(b")")[2].split()[0] not in (b"T", b"t", b"Z", b"X")


def _hold(path: Path) -> IO[str]:
    file = open(path, "a+", encoding="ascii")  # noqa: SIM115 - the lock lives as long as the server
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        file.close()
        raise AlreadyRunning(f"{path}: another motion engine runs in this folder") from error
    return file


def _listen(path: Path) -> socket.socket:
    if len(str(path).encode()) > _LONGEST_SOCKET_PATH:
        raise OSError(f"{path}: a socket's path may have {_LONGEST_SOCKET_PATH} bytes")
    path.unlink(missing_ok=True)  # of a dead engine; the lock shows that none is alive
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC)
    listener.bind(str(path))
    path.chmod(0o600)
    listener.listen(64)
    return listener

"""The engine's server with misbehaving clients, and its pace."""

from __future__ import annotations

import contextlib
import socket
import struct
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.runtime import AlreadyRunning
from robot_stack.wmx.api import EngineState, ErrorCode, OperationState
from robot_stack.wmx.bus import DriveCommands, DriveFeedback
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.server import EngineServer
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives
from robot_stack.wmx.simulated.channel import StatusView
from robot_stack.wmx.simulated.protocol import LARGEST_FRAME, Decoder, FrameError, encode
from tests.support.waiting import wait_for
from tests.unit.wmx.conformance import cruising, vel
from tests.unit.wmx.harness import (
    N_AXES,
    VEL,
    ThreadHarness,
    engine_config,
    engine_in_thread,
    runtime_folder,
    some_cycles,
    status,
    wait_status,
)

MALFORMED = {
    "zero length": struct.pack("<I", 0),
    "huge length": struct.pack("<I", 0xFFFFFFFF),
    "just too long": struct.pack("<I", LARGEST_FRAME + 1),
    "no JSON": struct.pack("<I", 5) + b"hello",
    "not UTF-8": struct.pack("<I", 4) + b"\xff\xfe\xfd\xfc",
    "no list": struct.pack("<I", 9) + b'{"a": 1} ',
    "empty list": struct.pack("<I", 2) + b"[]",
    "one element": struct.pack("<I", 3) + b"[1]",
    "number is text": struct.pack("<I", 9) + b'["1","x"]',
    "number is a bool": struct.pack("<I", 10) + b'[true,"x"]',
    "deep": struct.pack("<I", 100_000) + b"[" * 100_000,
    "endless integer": struct.pack("<I", 10_005) + b"[" + b"9" * 10_000 + b',"x"]'[:4],
}


@pytest.fixture(scope="module")
def server() -> Iterator[ThreadHarness]:
    with engine_in_thread() as server:
        yield server


@pytest.fixture
def harness(server: ThreadHarness) -> Iterator[ThreadHarness]:
    yield server
    server.end_test()


class TestProtocol:
    MESSAGES = st.lists(
        st.tuples(st.integers(0, 2**31), st.text(max_size=20), st.lists(st.floats(allow_nan=False), max_size=5)),
        max_size=5,
    )

    @given(MESSAGES, st.integers(1, 50))
    def test_round_trip_in_pieces(self, messages: list[tuple[int, str, list[float]]], size: int) -> None:
        sent = [list(message) for message in messages]
        stream = b"".join(encode(message) for message in sent)
        decoder = Decoder()
        received = []
        for start in range(0, len(stream), size):
            received += decoder.feed(stream[start : start + size])
        assert received == sent

    @pytest.mark.parametrize("data", list(MALFORMED.values()), ids=list(MALFORMED))
    def test_malformed(self, data: bytes) -> None:
        with pytest.raises(FrameError):
            Decoder().feed(data)

    @given(st.binary(max_size=200))
    def test_any_bytes(self, data: bytes) -> None:
        try:
            messages = Decoder().feed(data)
        except FrameError:
            return
        assert all(isinstance(message, list) for message in messages)

    def test_too_long_to_send(self) -> None:
        with pytest.raises(FrameError, match="may have"):
            encode([1, "x" * LARGEST_FRAME])


class TestMisbehaviour:
    def test_malformed_request_closes_connection_without_affecting_other_clients(self, harness: ThreadHarness) -> None:
        engine = harness.ready()
        assert engine.core_motion.velocity.StartVel(vel(VEL, 2.0)) == ErrorCode.PyNone
        for name, data in MALFORMED.items():
            with harness.raw_socket() as vandal:
                vandal.sendall(data)
                assert vandal.recv(100) == b"", name
        assert some_cycles(engine, 20).op_state[VEL] == OperationState.Velocity

    def test_frames_in_pieces_and_together(self, harness: ThreadHarness) -> None:
        engine = harness.ready()
        with harness.raw_socket() as client:
            first = encode([0, "CreateDevice", 0])
            client.sendall(first[:-1])
            assert engine.api.GetDeviceName()[0] == ErrorCode.PyNone, "half a frame holds up no other client"
            frames = [encode([number, "WMX3Api.GetDeviceName"]) for number in range(1, 500)]
            client.sendall(first[-1:] + b"".join(frames))
            decoder, answers = Decoder(), []
            while len(answers) < 500:
                answers += decoder.feed(client.recv(65536))
        assert [answer[0] for answer in answers] == list(range(500)), "all, in order"
        assert all(answer[1] == 0 for answer in answers)

    def test_client_that_never_reads_is_cut_off(self, harness: ThreadHarness) -> None:
        engine = harness.ready()
        with harness.raw_socket() as deaf:
            deaf.sendall(encode([0, "CreateDevice", 0]))
            wait_for(lambda: engine.api.GetAllDevices()[1].count == 2, "its device")
            deaf.settimeout(0.05)
            talk = _EndlessTalk(deaf, encode([1, "config.GetAxisParam"]))
            wait_for(lambda: not talk.goes_on(), "the deaf client to be cut off", poll_s=0.0)
        wait_for(lambda: engine.api.GetAllDevices()[1].count == 1, "its device to go")
        assert status(engine).communicating

    def test_too_many_clients(self, harness: ThreadHarness) -> None:
        engine = harness.ready()
        sockets: list[socket.socket] = []
        try:
            for _ in range(80):
                sockets.append(harness.raw_socket())
            assert engine.api.GetDeviceName()[0] == ErrorCode.PyNone
            # 63 connections occupy a place beside the device; one more is closed at once.
            wait_for(lambda: _is_closed(sockets[-1]), "the surplus client to be closed")
            assert not _is_closed(sockets[0])
        finally:
            for connection in sockets:
                connection.close()
        wait_for(lambda: harness.connect().api.IsDeviceValid(), "room again")

    def test_client_that_dies_while_its_device_is_created(self) -> None:
        with runtime_folder() as folder:
            server = {"create_device_s": 0.1, "pause_publish_s": 0.02, "max_clients": 8, "shutdown_stop_s": 2.0}
            harness = ThreadHarness(folder, server=server)
            try:
                with harness.raw_socket() as impatient:
                    impatient.sendall(encode([0, "CreateDevice", 0]))
                    wait_for(lambda: harness.server.creating, "the creation under way", poll_s=0.001)
                engine = harness.connect()
                assert engine.api.GetAllDevices()[1].count == 1
                harness.end_test()
            finally:
                harness.stop()


class _EndlessTalk:
    """Repeats one well-formed frame, cut at arbitrary places by the socket's buffer."""

    def __init__(self, connection: socket.socket, frame: bytes) -> None:
        self._socket, self._frame, self._left = connection, frame, frame

    def goes_on(self) -> bool:
        """Returns False once the peer has closed the connection; a full buffer does not count."""
        try:
            self._left = self._left[self._socket.send(self._left) :] or self._frame
        except TimeoutError:
            return True
        except OSError:
            return False
        return True


def _is_closed(connection: socket.socket) -> bool:
    connection.setblocking(False)
    try:
        return connection.recv(1) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


class Manual:
    """A server stepped by the test, on a clock set by the test."""

    def __init__(self, folder: Path) -> None:
        self.now_ns = time.monotonic_ns()
        self.drives = VirtualDrives(N_AXES, 0.001)
        self.engine = Engine(engine_config(), self.drives)
        self.server = EngineServer(self.engine, folder, clock_ns=lambda: self.now_ns)
        self.view = StatusView(folder, stale_s=1e9)


@pytest.fixture
def manual() -> Iterator[Manual]:
    with runtime_folder() as folder:
        manual = Manual(folder)
        yield manual
        manual.server.close()


class TestTurns:
    def test_each_cycle_is_published(self, manual: Manual) -> None:
        for count in range(1, 4):
            manual.server.cycle()
            assert manual.view.read()[1].cycle_counter == count

    def test_standing_world_keeps_its_status_fresh(self, manual: Manual) -> None:
        manual.server.cycle()
        first = manual.view.read()[1]
        manual.server.poll()
        assert manual.view.read()[1].stamp_ns == first.stamp_ns, "not at every turn"
        manual.now_ns += 30_000_000
        manual.server.poll()
        later = manual.view.read()[1]
        assert later.stamp_ns == manual.now_ns
        assert later.cycle_counter == first.cycle_counter

    def test_standing_world_answers_and_shows_it_first(self, manual: Manual, monkeypatch: pytest.MonkeyPatch) -> None:
        """The status contains the effect of a call before the call returns."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
            client.connect(str(manual.server._path))
            client.sendall(encode([1, "CreateDevice", 0]))
            decoder, answers = Decoder(), []
            client.setblocking(False)
            for _ in range(50):
                manual.server.poll()
                try:
                    answers += decoder.feed(client.recv(1000))
                except BlockingIOError:
                    continue
                break
            assert answers[0][:2] == [1, 0]
            assert manual.view.read()[1].engine_state is EngineState.Running

    def test_an_answer_too_long_is_an_error_and_no_end(self, manual: Manual, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("robot_stack.wmx.engine_server.server.execute", lambda *_: (0, ["x" * LARGEST_FRAME]))
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
            client.connect(str(manual.server._path))
            client.settimeout(20.0)
            client.sendall(encode([7, "config.GetAxisParam"]))
            for _ in range(5):
                manual.server.cycle()
            assert Decoder().feed(client.recv(1000)) == [[7, int(ErrorCode.SystemError)]]

    def test_requests_that_wait_do_not_pile_up_in_the_engine(self, manual: Manual) -> None:
        """A flood stays in the limited socket buffer, so its sender has to wait."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as flood:
            flood.connect(str(manual.server._path))
            flood.setblocking(False)
            talk = encode([1, "WMX3Api.GetDeviceName"]) * 1000
            waiting = []
            for _ in range(300):
                with contextlib.suppress(BlockingIOError):
                    flood.send(talk)
                with contextlib.suppress(BlockingIOError):
                    flood.recv(1 << 20)
                manual.server.poll()
                waiting.append(max(len(client.requests) for client in manual.server._clients.values()))
        at_once = 16384 // len(encode([1, "WMX3Api.GetDeviceName"])) + 1
        assert at_once - 32 <= max(waiting) <= at_once + 32

    def test_second_server_is_refused(self, manual: Manual) -> None:
        engine = Engine(engine_config(), VirtualDrives(N_AXES, 0.001))
        with pytest.raises(AlreadyRunning, match="another motion engine"):
            EngineServer(engine, manual.server._path.parent)

    def test_socket_path_too_long(self, tmp_path: Path) -> None:
        engine = Engine(engine_config(), VirtualDrives(N_AXES, 0.001))
        with pytest.raises(OSError, match="107 bytes"):
            EngineServer(engine, tmp_path / ("x" * 110))

    def test_close_leaves_no_socket(self) -> None:
        with runtime_folder() as folder:
            manual = Manual(folder)
            path = manual.server._path
            assert path.exists()
            manual.server.close()
            assert not path.exists()
            again = Manual(folder)
            again.server.close()


class TestPace:
    def test_missed_cycles_are_skipped_and_counted_as_overruns(self) -> None:
        class Slow(VirtualDrives):
            def exchange(self, out: DriveCommands, inp: DriveFeedback) -> bool:
                end = time.monotonic() + 0.0035
                while time.monotonic() < end:
                    pass
                return super().exchange(out, inp)

        with runtime_folder() as folder:
            engine = Engine(engine_config(), Slow(N_AXES, 0.001))
            server = EngineServer(engine, folder)
            engine.create_device(0)
            engine.start_communication()
            server.serve_forever(lambda: engine.condition.cycles >= 20)
            server.close()
            assert engine.condition.cycles == 20, "no burst to catch up"
            assert engine.condition.overruns >= 20 * 2

    def test_orderly_shut_down_ramps_first(self) -> None:
        with runtime_folder() as folder:
            harness = ThreadHarness(folder)
            engine = harness.ready()
            assert engine.core_motion.velocity.StartVel(vel(VEL, 20.0, acc=0.0)) == ErrorCode.PyNone
            wait_status(engine, cruising(VEL, 20.0), "motion")
            speeds: list[float] = []
            exchange = harness.drives.exchange

            def watched(out: DriveCommands, inp: DriveFeedback) -> bool:
                speeds.append(float(out.velocity_counts_per_s[VEL]) if out.servo_on[VEL] else 0.0)
                return exchange(out, inp)

            harness._ended.set()
            harness._thread.join(30.0)
            harness.drives.exchange = watched  # type: ignore[method-assign]
            harness.server.shut_down()
            assert len(speeds) >= 100, "20 rad/s at 200 rad/s2 takes 100 ms"
            assert all(after <= before for before, after in pairwise(speeds))
            assert speeds[-1] == 0.0
            engine.close()

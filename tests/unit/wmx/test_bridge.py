"""The engine bridge on the stand-in of the vendor's library, which is a client of a simulated engine."""

from __future__ import annotations

import os
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import EngineState, ErrorCode, EStopLevel, OperationState, Profile, Velocity_TimedVelCommand
from robot_stack.wmx.api.errors import CoreMotionErrorCode as Code
from robot_stack.wmx.bridge import generate
from robot_stack.wmx.engine_server.requests import METHODS
from robot_stack.wmx.simulated.channel import StatusView
from robot_stack.wmx.simulated.protocol import LARGEST_FRAME, SOCKET_FILE, Decoder, encode, pack
from robot_stack.wmx.vendor.snapshots import NEEDED
from tests.support.waiting import wait_for
from tests.support.wmx.bridge import BridgeProcess, build, compiler
from tests.unit.wmx.conformance import CallConformance, cruising, vel
from tests.unit.wmx.harness import (
    N_AXES,
    QUICK_STOP_DEC,
    VEL,
    VEL_MIRRORED,
    Harness,
    ProcessHarness,
    engine_state,
    runtime_folder,
    status,
    wait_status,
)

GOOD = ErrorCode.PyNone
N_IO_BYTES = 4


class BridgeHarness(Harness):
    """A simulated engine in a process, and the bridge on it in another. ``folder`` is the bridge's."""

    def __init__(self, program: Path, folder: Path, engine_folder: Path, **options: int) -> None:
        super().__init__(folder)
        self.config = self.config.model_copy(update={"engine": "vendor", "path": "/opt/lmx/", "bridge": str(folder)})
        self.engine = ProcessHarness(engine_folder)
        given = {"axes": N_AXES, "io_bytes": N_IO_BYTES, **options}
        self._start = lambda: BridgeProcess(program, folder, engine_folder, **given)
        self.bridge = self._start()

    def restart(self) -> None:
        """Another bridge takes over."""
        self.bridge = self._start()

    def end(self) -> None:
        """Ends both processes."""
        for process in (self.bridge.process, self.engine.process):
            process.send_signal(signal.SIGCONT)
            process.kill()
            process.communicate()


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bridge, compiled."""
    return build(tmp_path_factory.mktemp("bridge"))


@contextmanager
def bridged(program: Path, **options: int) -> Iterator[BridgeHarness]:
    """Yields a bridge of its own for one test."""
    with runtime_folder() as folder, runtime_folder() as engine_folder:
        harness = BridgeHarness(program, folder, engine_folder, **options)
        try:
            yield harness
        finally:
            harness.end()


@pytest.fixture(scope="module")
def running(program: Path) -> Iterator[BridgeHarness]:
    with bridged(program) as harness:
        yield harness


@pytest.fixture
def harness(running: BridgeHarness) -> Iterator[BridgeHarness]:
    yield running
    running.end_test()


class TestBridge(CallConformance):
    """Every call. The motion is the simulated engine's (test_process.py)."""


# -- the tables --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", generate.FILES)
def test_generated_tables_are_up_to_date(name: str) -> None:
    text = (generate.FOLDER / name).read_text(encoding="utf-8")
    assert text == generate.FILES[name](), "run python -m robot_stack.wmx.bridge.generate"


_READS_AXES = """
#include <CoreMotionApi.h>
using namespace wmx3Api;
#include "generated/vendor.hpp"
struct Rows {
    template <class F> void flag(int, F&, bool) {}
    void real(int, double, bool) {}
};
void read(CoreMotionAxisStatus& axis) { vendor::visit_status(axis, Rows{}); }
"""


def test_headers_without_a_needed_field_do_not_compile(tmp_path: Path) -> None:
    header = (generate.FOLDER / "standin" / "CoreMotionApi.h").read_text(encoding="utf-8")
    unit = tmp_path / "reads.cpp"
    unit.write_text(_READS_AXES, encoding="utf-8")
    command = [compiler(), "-std=c++20", "-fsyntax-only", f"-I{tmp_path}", f"-I{generate.FOLDER}"]
    command += [f"-I{generate.FOLDER / 'standin'}", str(unit)]

    def errors(*missing: str) -> str:
        changed = re.sub(rf"\b({'|'.join(missing)})\b", r"\1Renamed", header)
        (tmp_path / "CoreMotionApi.h").write_text(changed, encoding="utf-8")
        done = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)
        return done.stderr.replace("\u2018", "'").replace("\u2019", "'")

    assert errors("homeDone", "inPos") == "", "a field that is not needed"
    text = errors(*NEEDED)
    assert [field for field in NEEDED if f"'{field}'" not in text] == []


# -- requests ----------------------------------------------------------------------------------------------------------


def ask(connection: socket.socket, *message: object) -> list[object]:
    """Sends a request and returns the answer without its number."""
    connection.sendall(encode([1, *message]))
    decoder = Decoder()
    while True:
        data = connection.recv(65536)
        assert data, "the connection is closed"
        for number, *answer in decoder.feed(data):
            assert number == 1
            return answer


def create_device(connection: socket.socket) -> None:
    """Waits for the engine, which on a busy machine starts later than the bridge waits for it."""
    wait_for(lambda: ask(connection, "CreateDevice", 0)[0] == GOOD, "a device")


def test_every_request_of_the_engine_is_known(harness: BridgeHarness) -> None:
    with harness.raw_socket() as connection:
        codes = {method: ask(connection, method, *[None] * 9)[0] for method in METHODS}
    assert codes == dict.fromkeys(METHODS, ErrorCode.ArgumentOutOfRange), "nine arguments are too many for any"


BAD_ARGUMENTS: list[tuple[object, ...]] = [
    ("axisControl.SetServoOn", [0]),
    ("axisControl.SetServoOn", [0], 1, 1),
    ("axisControl.SetServoOn", 0, 1),
    ("axisControl.SetServoOn", [True], 1),
    ("axisControl.SetServoOn", [0.0], 1),
    ("axisControl.SetServoOn", [0] * 129, 1),
    ("axisControl.SetServoOn", [0], 2**80),
    ("motion.StartPos", [[0, 1.0]]),
    ("motion.StartPos", [[0, 1.0, [0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]]]),
    ("motion.StartPos", [[0, "1", [0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]]]),
    ("config.SetMotionParam", 0, [100.0, 1, 0]),
    ("StartSpline", 0, [0], "AAAA", "AAAA"),
    ("StartSpline", 0, [0], "not base64", ""),
    ("SetAllParameters", [], []),
    ("WMX3Api.SetDeviceName", {}),
]
NO_FRAMES = [
    struct.pack("<I", 0),
    struct.pack("<I", LARGEST_FRAME + 1),
    struct.pack("<I", 3) + b"[1]",
    struct.pack("<I", 4) + b"\xff\xff\xff\xff",
    struct.pack("<I", 10) + b'[[1],"abc"',
    struct.pack("<I", 10) + b'[true,"ab"]'[:10],
    struct.pack("<I", 2000) + b"[" * 2000,
    struct.pack("<I", 8) + b'[01,"a"]',
    struct.pack("<I", 11) + b'[1,"\xed\xa0\x80"] ]',
]


def test_bad_requests_are_refused(harness: BridgeHarness) -> None:
    with harness.raw_socket() as connection:
        create_device(connection)
        for method in ("", "config.SetSomething", 7, None, ["config.GetGearRatio"], {"name": 1}):
            assert ask(connection, method) == [ErrorCode.NoSupportedFunction], method
        for arguments in BAD_ARGUMENTS:
            assert ask(connection, *arguments) == [ErrorCode.ArgumentOutOfRange], arguments
        assert ask(connection, "CloseDevice") == [GOOD]


def test_sender_of_no_frame_is_disconnected(harness: BridgeHarness) -> None:
    engine = harness.connect()
    for data in NO_FRAMES:
        with harness.raw_socket() as connection:
            connection.sendall(data)
            assert connection.recv(1) == b"", data
        assert engine.api.GetDeviceName() == (GOOD, "test"), "others are unharmed"


def test_frames_may_arrive_in_pieces_and_together(harness: BridgeHarness) -> None:
    with harness.raw_socket() as connection:
        frames = encode([1, "CreateDevice", 0]) + encode([2, "WMX3Api.SetDeviceName", "Prüfling \N{WHEELCHAIR SYMBOL}"])
        for byte in frames[:-1]:
            connection.sendall(bytes([byte]))
        connection.sendall(frames[-1:] + encode([3, "WMX3Api.GetDeviceName"]))
        decoder, answers = Decoder(), []
        while len(answers) < 3:
            answers += decoder.feed(connection.recv(65536))
        assert [answer[:2] for answer in answers] == [[1, GOOD], [2, GOOD], [3, GOOD]]
        assert answers[2][2] == "Prüfling \N{WHEELCHAIR SYMBOL}"
        assert ask(connection, "CloseDevice") == [GOOD]


def test_axis_that_the_status_does_not_have_is_refused(program: Path) -> None:
    with bridged(program, axes=VEL) as harness:
        engine = harness.connect()
        for axis in (VEL, -1):
            assert engine.core_motion.velocity.StartVel(vel(axis, 5.0)) == ErrorCode.AxisOutOfRange
            assert engine.core_motion.axisControl.SetServoOn(axis, 1) == ErrorCode.AxisOutOfRange
        assert engine.core_motion.axisControl.SetServoOn(VEL - 1, 1) != ErrorCode.AxisOutOfRange


def test_number_that_is_not_finite_does_not_reach_the_engine(program: Path) -> None:
    nan, inf = float("nan"), float("inf")
    commands: list[tuple[tuple[object, ...], int]] = [
        (("velocity.StartVel", [[VEL, [0, nan, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]]]), Code.VelocityArgumentOutOfRange),
        (("motion.StartPos", [[0, inf, [0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]]]), Code.PositionArgumentOutOfRange),
        (("home.SetCommandPos", 0, nan), Code.PositionArgumentOutOfRange),
        (("config.SetGearRatio", 0, nan, 1.0), ErrorCode.ArgumentOutOfRange),
        (("config.SetMotionParam", 0, [nan, 1, False]), Code.ParameterSettingsInvalid),
        (("StartSpline", 0, [0], pack([[nan]]), pack([1.0])), Code.PositionArgumentOutOfRange),
    ]
    with bridged(program) as harness, harness.raw_socket() as connection:
        create_device(connection)
        harness.engine.process.send_signal(signal.SIGSTOP)
        assert [ask(connection, *request) for request, _ in commands] == [[code] for _, code in commands]


def frames(*requests: tuple[object, ...]) -> bytes:
    return b"".join(encode([number, *request]) for number, request in enumerate(requests, 1))


def test_moving_command_that_its_client_has_given_up_is_refused(program: Path) -> None:
    with bridged(program) as harness:
        observer = harness.connect("observer")
        late, stop, name = (
            ("axisControl.SetServoOn", [0], 1),
            ("axisControl.SetServoOn", [0], 0),
            ("WMX3Api.GetDeviceName",),
        )
        with harness.raw_socket() as connection, harness.raw_socket() as dead:
            for one in (connection, dead):
                create_device(one)
            harness.bridge.process.send_signal(signal.SIGSTOP)  # hangs for longer than its clients wait
            connection.sendall(frames(late, stop, ("CoreMotion.ReleaseEStop",), name))
            dead.sendall(frames(late))
            dead.shutdown(socket.SHUT_WR)
            harness.bridge.process.send_signal(signal.SIGCONT)
            decoder, answers = Decoder(), []
            while len(answers) < 4:
                answers += decoder.feed(connection.recv(65536))
            given_up = ErrorCode.APIChannelTimeOut
            assert [code == given_up for _, code, *_ in answers] == [True, False, True, False]
            assert Decoder().feed(dead.recv(65536)) == [[1, given_up]]
            assert ask(connection, *late) != [given_up], "the client waits for it"
        assert observer.api.GetDeviceName()[0] == GOOD


# -- the ends of a process ---------------------------------------------------------------------------------------------


def timed(velocity: float, time_ms: float) -> Velocity_TimedVelCommand:
    return Velocity_TimedVelCommand(VEL, time_ms, Profile.SetupTimeAccTrapezoidal(velocity, 100.0, 100.0))


_VICTIM = """
import sys
from pathlib import Path
from tests.unit.wmx.harness import Harness, VEL
from tests.unit.wmx.test_bridge import timed
engine = Harness(Path(sys.argv[1])).ready("victim")
assert engine.core_motion.velocity.StartVel_TimedVel(timed(5.0, 2000.0)) == 0
print("moving", flush=True)
sys.stdin.read()
"""


def test_timed_velocity_ends_and_the_device_closes_after_its_client_was_killed(program: Path) -> None:
    with bridged(program, orphan_ms=1000) as harness:
        observer = harness.connect("observer")
        victim = subprocess.Popen(
            [sys.executable, "-c", _VICTIM, str(harness.folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert victim.stdout is not None
        assert victim.stdout.readline() == b"moving\n"
        wait_status(observer, cruising(VEL, 5.0), "motion")
        victim.kill()
        victim.communicate()
        assert observer.api.GetAllDevices()[1].count == 2, "it keeps its device for a while"
        wait_status(observer, lambda now: now.op_state[VEL] == OperationState.Idle, "the dead-man")
        wait_for(lambda: observer.api.GetAllDevices()[1].count == 1, "its device to be closed")
        assert status(observer).servo_on.all()


def test_last_client_killed_ends_the_engine(program: Path) -> None:
    with bridged(program, orphan_ms=200) as harness:
        with harness.raw_socket() as connection:
            create_device(connection)
            wait_for(lambda: engine_state(harness.engine.folder) is EngineState.Running, "the engine to run")
        wait_for(lambda: engine_state(harness.engine.folder) is EngineState.Idle, "the engine to end")
        wait_for(lambda: engine_state(harness.folder) is EngineState.Idle, "the bridge to show it")


def test_killed_bridge_gives_clear_codes_and_a_new_one_takes_over(program: Path) -> None:
    with bridged(program) as harness:
        harness.config = harness.config.model_copy(update={"status_stale_s": 0.5})
        engine = harness.ready()
        harness.bridge.kill()
        assert engine.core_motion.velocity.Stop(VEL) == ErrorCode.IMLibIsNotRunning
        wait_for(lambda: engine.read_status()[0] == ErrorCode.StatusChannelError, "the status to go stale")
        assert not engine.api.IsDeviceValid()
        harness.restart()
        assert engine.read_status()[0] == ErrorCode.DeviceIsNull
        assert engine.api.CreateDevice(str(harness.folder), 0, 20000) == GOOD
        assert status(engine).communicating, "the engine has not noticed"


def test_killed_engine_ends_every_device(program: Path) -> None:
    with bridged(program) as harness:
        engine = harness.ready()
        harness.engine.process.kill()
        assert engine.core_motion.velocity.Stop(VEL) in (ErrorCode.IMLibIsNotRunning, ErrorCode.DeviceIsNull)
        wait_for(lambda: engine.read_status()[0] == ErrorCode.DeviceIsNull, "the bridge to notice")
        code = engine.api.CreateDevice(str(harness.folder), 0, 0)
        assert code in (ErrorCode.IMLibIsNotRunning, ErrorCode.EngineNotStartedInSpecifiedTime)


def test_answer_comes_after_the_effect_on_the_status(program: Path) -> None:
    with bridged(program, period_us=100_000) as harness:
        engine = harness.ready()
        for moving in (True, False):
            if moving:
                assert engine.core_motion.velocity.StartVel(vel(VEL, 5.0)) == GOOD
            else:
                assert engine.core_motion.axisControl.SetServoOn(VEL, 0) == GOOD
                assert engine.api.StopCommunication() == GOOD
            assert bool(status(engine).op_state[VEL]) is moving


@pytest.mark.parametrize("communicating", [True, False])
def test_hanging_engine_makes_the_status_stale(program: Path, communicating: bool) -> None:
    with bridged(program) as harness:
        harness.config = harness.config.model_copy(update={"call_timeout_s": 0.2, "status_stale_s": 0.2})
        engine = wait_for(lambda: _connected(harness, communicating), "a device")
        harness.engine.process.send_signal(signal.SIGSTOP)
        assert engine.api.SetDeviceName("late") == ErrorCode.APIChannelTimeOut
        wait_for(lambda: engine.read_status()[0] == ErrorCode.StatusChannelError, "stale status")


def _connected(harness: Harness, communicating: bool) -> MotionEngine | None:
    engine = harness.connect()
    return engine if not communicating or engine.api.StartCommunication(20000) == GOOD else None


def test_sigterm_stops_the_axes_before_the_bridge_ends(program: Path) -> None:
    with bridged(program) as harness:
        engine = harness.ready()
        with harness.engine.raw_socket() as connection:  # a client of the engine itself keeps it running
            create_device(connection)
            assert engine.core_motion.velocity.StartVel(vel(VEL, 100.0, acc=0.0)) == GOOD
            assert engine.core_motion.velocity.StartVel(vel(VEL_MIRRORED, -10.0)) == GOOD
            wait_status(engine, cruising(VEL, 100.0), "motion")
            harness.bridge.process.send_signal(signal.SIGTERM)
            slowing = wait_status(engine, lambda now: 0.0 < now.velocity_cmd[VEL] < 100.0, "the ramp")
            assert slowing.servo_on[VEL]
            assert abs(slowing.reals[7, VEL]) == pytest.approx(QUICK_STOP_DEC)
            assert harness.bridge.stop() == 0
            wait_for(lambda: not _moving(harness.engine.folder), "rest")
            assert engine_state(harness.engine.folder) is EngineState.Communicating
        assert not (harness.folder / SOCKET_FILE).exists()


def _moving(folder: Path) -> bool:
    return bool(StatusView(folder, 5.0).read()[1].op_state.any())


def test_hanging_status_holds_up_no_command(program: Path) -> None:
    with bridged(program) as harness:
        harness.config = harness.config.model_copy(update={"status_stale_s": 0.2})
        engine = harness.ready()
        other = harness.connect("other")
        delay_status(harness, 0)
        for client in (engine, other):
            assert client.api.SetDeviceName("present") == GOOD
        assert engine.core_motion.velocity.StartVel(vel(VEL, 5.0)) == GOOD
        wait_for(lambda: _moving(harness.engine.folder), "motion")
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        wait_for(lambda: not _moving(harness.engine.folder), "rest")
        assert other.core_motion.ReleaseEStop() == GOOD
        wait_for(lambda: engine.read_status()[0] == ErrorCode.StatusChannelError, "stale status")


def delay_status(harness: BridgeHarness, milliseconds: int) -> None:
    """Delays the bridge's own reading of the status from here on; 0: it hangs, -1: its device is lost."""
    (harness.engine.folder / "standin.status_ms").write_text(f"{milliseconds}", encoding="ascii")


@pytest.mark.parametrize(
    ("milliseconds", "end"),
    [(0, (1, "wmx_bridge: the engine does not answer\n")), (-1, (0, ""))],
    ids=["hangs", "device lost"],
)
def test_end_stops_the_axes_without_the_bridges_own_device(
    program: Path, milliseconds: int, end: tuple[int, str]
) -> None:
    with bridged(program) as harness:
        engine = harness.ready()
        with harness.engine.raw_socket() as connection:
            create_device(connection)
            assert engine.core_motion.velocity.StartVel(vel(VEL, 100.0)) == GOOD
            wait_status(engine, cruising(VEL, 100.0), "motion")
            delay_status(harness, milliseconds)
            if milliseconds < 0:
                wait_for(lambda: engine.read_status()[0] == ErrorCode.DeviceIsNull, "the loss")
            harness.bridge.process.send_signal(signal.SIGTERM)
            _, errors = harness.bridge.process.communicate(timeout=30.0)
            assert (harness.bridge.process.returncode, errors) == end
            assert not _moving(harness.engine.folder)
            assert engine_state(harness.engine.folder) is EngineState.Communicating


def test_engine_lives_on_after_a_creation_that_failed(program: Path) -> None:
    """The client repeats it; an engine that ended meanwhile would start again and again."""
    with bridged(program) as harness, harness.raw_socket() as connection:
        refusal = harness.engine.folder / "standin.no_device"
        late = ErrorCode.EngineNotStartedInSpecifiedTime
        harness.engine.process.send_signal(signal.SIGSTOP)
        assert ask(connection, "CreateDevice", 0) == [late]
        harness.engine.process.send_signal(signal.SIGCONT)
        wait_for(lambda: engine_state(harness.folder) is EngineState.Running, "the engine")
        refusal.touch()
        assert ask(connection, "CreateDevice", 0) == [late]
        refusal.unlink()
        assert engine_state(harness.folder) is EngineState.Running
        create_device(connection)


def test_other_signals_end_it_like_sigterm(program: Path) -> None:
    with bridged(program) as harness:
        for number in (signal.SIGINT, signal.SIGHUP):
            harness.bridge.process.send_signal(number)
            assert harness.bridge.process.wait(30.0) == 0
            assert not (harness.folder / SOCKET_FILE).exists()
            harness.bridge.process.communicate()
            harness.restart()


def test_second_bridge_in_the_same_folder_is_refused(harness: BridgeHarness, program: Path) -> None:
    command = [str(program), "--folder", str(harness.folder), "--root", "/nowhere"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)
    assert done.returncode == 1
    assert "another motion engine runs in this folder" in done.stderr
    assert engine_state(harness.folder) is EngineState.Idle, "the first one is unharmed"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "--folder and --root must be given"),
        (["--folder"], "--folder needs a value"),
        (["--axes", "0"], "--axes must be in 1..128, is 0"),
        (["--axes", "many"], "--axes must be in 1..128, is many"),
        (["--speed", "1"], "there is no option --speed"),
    ],
)
def test_bad_options_are_one_line(program: Path, options: list[str], message: str) -> None:
    done = subprocess.run([str(program), *options], capture_output=True, text=True, timeout=60.0, check=False)
    assert (done.returncode, done.stderr) == (1, f"wmx_bridge: {message}\n")


def test_files_are_for_owner_and_group_only(harness: BridgeHarness) -> None:
    assert os.stat(harness.folder / SOCKET_FILE).st_mode & 0o777 == 0o660
    assert os.stat(harness.folder / "engine.status").st_mode & 0o777 == 0o640


def test_status_is_stamped_by_the_monotonic_clock_and_follows_it(harness: BridgeHarness) -> None:
    engine = harness.communicating()
    for _ in range(3):
        asked_ns = time.monotonic_ns()
        wait_for(lambda: status(engine).age_s(asked_ns) <= 0.0, "a status of a later cycle")  # noqa: B023
        assert status(engine).age_s(time.monotonic_ns()) >= 0.0, "not of the future"

"""The port to an engine in its own process, over socket and shared memory, and effects that only processes have."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from robot_stack.wmx import EngineError, MotionEngine, connect
from robot_stack.wmx.api import EngineState, ErrorCode, OperationState
from robot_stack.wmx.config import ClientConfig
from robot_stack.wmx.simulated.protocol import SOCKET_FILE
from tests.support.waiting import wait_for
from tests.unit.wmx.conformance import cruising, in_state, vel
from tests.unit.wmx.harness import (
    VEL,
    VEL_MIRRORED,
    ProcessHarness,
    engine_state,
    runtime_folder,
    wait_status,
)
from tests.unit.wmx.motion_conformance import EngineConformance


@pytest.fixture(scope="module")
def engine_process() -> Iterator[ProcessHarness]:
    with runtime_folder() as folder:
        harness = ProcessHarness(folder)
        try:
            yield harness
            assert harness.stop() == 0
        finally:
            harness.process.kill()
            harness.process.wait()


@pytest.fixture
def harness(engine_process: ProcessHarness) -> Iterator[ProcessHarness]:
    yield engine_process
    engine_process.end_test()


class TestEngineProcess(EngineConformance):
    """Every conformance test."""


CLIENT = """
import sys, time
from pathlib import Path
from tests.unit.wmx.harness import client_config
from robot_stack.wmx import connect
from robot_stack.wmx.api import Profile, Velocity_TimedVelCommand, Velocity_VelCommand
from tests.unit.wmx.harness import VEL, VEL_MIRRORED
engine = connect("victim", client_config(Path(sys.argv[1])))
assert engine.core_motion.velocity.StartVel(Velocity_VelCommand(VEL, Profile.SetupTrapezoidal(2.0, 400.0, 400.0))) == 0
timed = Velocity_TimedVelCommand(VEL_MIRRORED, 2000.0, Profile.SetupTimeAccTrapezoidal(2.0, 5.0, 5.0))
assert engine.core_motion.velocity.StartVel_TimedVel(timed) == 0
print("moving", flush=True)
time.sleep(600)
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "hung"])
def test_client_process_that_does_not_run_loses_its_device_and_timed_axes_only(
    harness: ProcessHarness, number: signal.Signals
) -> None:
    """The watchdog closes the device: an endless motion continues, a timed one ends by itself."""
    survivor = harness.ready("survivor")
    victim = subprocess.Popen([sys.executable, "-c", CLIENT, str(harness.folder)], stdout=subprocess.PIPE, text=True)
    try:
        assert victim.stdout is not None
        assert victim.stdout.readline() == "moving\n"
        both = lambda now: cruising(VEL, 2.0)(now) and cruising(VEL_MIRRORED, 2.0)(now)  # noqa: E731
        wait_status(survivor, both, "the victim's axes moving")
        victim.send_signal(number)
        wait_for(lambda: survivor.api.GetAllDevices()[1].count == 1, "the victim's device to be closed")
        snapshot = wait_status(survivor, in_state(VEL_MIRRORED, OperationState.Idle), "the end of the timed motion")
        assert snapshot.op_state[VEL] == OperationState.Velocity, "nobody stops an endless one"
        assert snapshot.servo_on.all()
    finally:
        victim.kill()
        victim.wait()
        if victim.stdout is not None:
            victim.stdout.close()


def test_killed_engine_gives_clear_codes_and_a_new_one_takes_over() -> None:
    with runtime_folder() as folder:
        first = ProcessHarness(folder)
        try:
            config = first.config.model_copy(update={"status_stale_s": 0.5})
            engine = connect("client", config)
            assert engine.api.StartCommunication(20000) == ErrorCode.PyNone
            assert engine.read_status()[0] == ErrorCode.PyNone
        finally:
            first.process.kill()
            first.process.wait()
            first.close_pipes()
        assert engine.core_motion.velocity.Stop(VEL) == ErrorCode.IMLibIsNotRunning
        assert engine.core_motion.ExecEStop(1) == ErrorCode.IMLibIsNotRunning
        wait_for(lambda: engine.read_status()[0] == ErrorCode.StatusChannelError, "the status to go stale")
        assert engine.io.GetOutBit(0, 0) == (ErrorCode.StatusChannelError, 0)
        assert engine.api.GetEngineStatus()[0] == ErrorCode.StatusChannelError
        assert not engine.api.IsDeviceValid()
        code, snapshot = engine.read_status()
        assert code == ErrorCode.StatusChannelError
        assert snapshot.age_s(time.monotonic_ns()) > 0.5
        second = ProcessHarness(folder, stale_socket=True)
        try:
            assert engine.read_status()[0] == ErrorCode.DeviceIsNull, "the old device is void"
            assert engine.api.CreateDevice(str(folder), 0, 20000) == ErrorCode.PyNone
            assert engine.read_status()[0] == ErrorCode.PyNone
            engine.close()
            assert second.stop() == 0
        finally:
            second.process.kill()
            second.process.wait()
        assert not (folder / SOCKET_FILE).exists()


def test_sigterm_stops_the_axes_before_the_engine_ends() -> None:
    with runtime_folder() as folder:
        harness = ProcessHarness(folder)
        try:
            engine = harness.ready()
            assert engine.core_motion.velocity.StartVel(vel(VEL, 100.0, acc=0.0)) == ErrorCode.PyNone
            wait_status(engine, cruising(VEL, 100.0), "motion")
            harness.process.send_signal(signal.SIGTERM)
            # Braking from 100 rad/s at 200 rad/s2 takes 0.5 s, long enough to observe it with the servo on.
            slowing = wait_status(engine, lambda now: 0.0 < now.velocity_cmd[VEL] < 100.0, "the ramp")
            assert slowing.servo_on[VEL]
            assert harness.stop() == 0
        finally:
            harness.process.kill()
            harness.process.wait()


def test_second_engine_in_the_same_folder_is_refused(engine_process: ProcessHarness) -> None:
    command = [sys.executable, "-m", "robot_stack.wmx.engine_server", "--runtime-dir", str(engine_process.folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)
    assert done.returncode == 1
    assert "another motion engine runs in this folder" in done.stderr
    assert engine_state(engine_process.folder) is EngineState.Idle, "the first one is unharmed"


def test_bad_configuration_stops_the_start_with_one_line(tmp_path: Path) -> None:
    path = tmp_path / "engine.yaml"
    path.write_text("cycle_time_s: 0.001\n", encoding="utf-8")
    command = [sys.executable, "-m", "robot_stack.wmx.engine_server", "--config", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)
    assert done.returncode == 1
    assert "axes: is missing" in done.stderr
    assert str(path) in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_calls_time_out_when_the_engine_hangs() -> None:
    """SIGSTOP: the socket accepts calls without an answer. They time out, and late answers are discarded."""
    with runtime_folder() as folder:
        harness = ProcessHarness(folder)
        try:
            config = harness.config.model_copy(update={"call_timeout_s": 0.2, "status_stale_s": 0.2})
            engine = wait_for(lambda: _connected(config), "a device")
            harness.process.send_signal(signal.SIGSTOP)
            assert engine.api.GetDeviceName() == (ErrorCode.APIChannelTimeOut, "")
            wait_for(lambda: engine.read_status()[0] == ErrorCode.StatusChannelError, "stale status")
            assert engine.api.SetDeviceName("late") == ErrorCode.APIChannelTimeOut
            harness.process.send_signal(signal.SIGCONT)
            # The abandoned calls are answered now; each call still gets its own answer.
            answer = wait_for(lambda: _unless_timed_out(engine.api.GetDeviceName()), "the engine back")
            assert answer == (ErrorCode.PyNone, "late")
            engine.close()
            assert harness.stop() == 0
        finally:
            harness.process.send_signal(signal.SIGCONT)
            harness.process.kill()
            harness.process.wait()


def _connected(config: ClientConfig) -> MotionEngine | None:
    try:
        return connect("client", config, timeout_s=1.0)
    except EngineError:
        return None


def _unless_timed_out(answer: tuple[int, str]) -> tuple[int, str] | None:
    return None if answer[0] == ErrorCode.APIChannelTimeOut else answer

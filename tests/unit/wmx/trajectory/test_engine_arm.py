"""The arm on an engine that records its calls and returns codes set by a test."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from robot_stack.wmx import EngineError
from robot_stack.wmx.api import CoreMotionErrorCode, EngineState, ErrorCode, OperationState
from robot_stack.wmx.axes import Flag, Real, empty_snapshot
from robot_stack.wmx.session import EngineSession, Patience
from robot_stack.wmx.trajectory.arm import ArmState, Blind, fault_of
from robot_stack.wmx.trajectory.engine_arm import EngineArm
from robot_stack.wmx.trajectory.spline import ClampedSpline

ALREADY = int(CoreMotionErrorCode.ChannelBufferMemoryAlreadyAllocated)
SPLINE = ClampedSpline(np.array([0.0, 0.5, 1.25]), np.array([[0.0, 0.0], [0.1, -0.1], [0.3, 0.2]]))


class FakeEngine:
    """codes: return code by call, 0 by default. Each module explains codes under its own name."""

    def __init__(self) -> None:
        self.calls: list[tuple[Any, ...]] = []
        self.codes: dict[str, list[int]] = {}
        self.buffer_points = 0
        self.output_sticks = True
        self.bit = 0
        self.closed = False
        snapshot = empty_snapshot(3)
        snapshot.flags[Flag.SERVO_OFFLINE] = 0
        snapshot.flags[Flag.SERVO_ON] = 1
        self.snapshot = replace(snapshot, engine_state=EngineState.Communicating, engine_time_s=7.0)
        self.api = SimpleNamespace(
            GetDeviceName=lambda: (self.answer("GetDeviceName"), "node"),
            ErrorToString=lambda code: f"base {code}",
        )
        motion = SimpleNamespace(Stop_AxisSel=self._call("Stop"), ExecQuickStop_AxisSel=self._call("QuickStop"))
        self.core_motion = SimpleNamespace(motion=motion, ErrorToString=lambda code: f"motion {code}")
        splines = SimpleNamespace(
            CreateSplineBuffer=self._call("CreateSplineBuffer"),
            FreeSplineBuffer=self._call("FreeSplineBuffer"),
            GetSplineBufferPoints=lambda channel: (0, self.buffer_points),
            StartCSplinePos_PointTime=self._call("Start"),
        )
        self.advanced_motion = SimpleNamespace(advMotion=splines, ErrorToString=lambda code: f"advanced {code}")
        self.io = SimpleNamespace(
            SetOutBit=self._set_bit, GetOutBit=lambda byte, bit: (0, self.bit), ErrorToString=lambda code: f"io {code}"
        )

    def _call(self, name: str) -> Any:
        def call(*arguments: Any) -> int:
            self.calls.append((name, *arguments))
            return self.answer(name)

        return call

    def answer(self, name: str) -> int:
        waiting = self.codes.get(name, [])
        return waiting.pop(0) if waiting else 0

    def _set_bit(self, byte: int, bit: int, value: int) -> int:
        self.calls.append(("SetOutBit", byte, bit, value))
        code = self.answer("SetOutBit")
        if self.output_sticks and not code:
            self.bit = value
        return code

    def read_status(self) -> tuple[int, Any]:
        return self.answer("read"), self.snapshot

    def close(self) -> None:
        self.closed = True


class Bench:
    def __init__(self) -> None:
        self.engine = FakeEngine()
        self.absent = False
        session = EngineSession(self._open, Patience(0.1, 5, 2.0, 0.1))
        self.arm = EngineArm(session, n_joints=2, max_points=1000)
        self.now_s = 0.0

    def _open(self) -> Any:
        if self.absent:
            raise EngineError("server: cannot create a device", ErrorCode.IMLibIsNotRunning, "no engine is running")
        return self.engine

    def poll(self, seconds: float = 0.0) -> str:
        self.now_s += seconds
        return self.arm.poll(self.now_s)

    def named(self, name: str) -> list[tuple[Any, ...]]:
        return [call for call in self.engine.calls if call[0] == name]


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_the_buffer_is_created_once_with_room_for_the_present_position(bench: Bench) -> None:
    assert bench.poll() == ""
    assert bench.poll(5.0) == ""
    assert bench.named("CreateSplineBuffer") == [("CreateSplineBuffer", 0, 1001)]


def test_a_trajectory_that_a_dead_server_left_is_stopped_before_anything_else(bench: Bench) -> None:
    """The engine continues the trajectory: only its end or a stop ends a spline."""
    bench.engine.snapshot.flags[Flag.OP_STATE, :2] = OperationState.Intpl
    assert bench.poll() == "stopping a trajectory whose server has ended"
    assert len(bench.named("Stop")) == 1
    assert bench.named("CreateSplineBuffer") == []
    bench.engine.snapshot.flags[Flag.OP_STATE, :2] = OperationState.Stop
    bench.poll(1.1)
    assert bench.named("CreateSplineBuffer") == []
    bench.engine.snapshot.flags[Flag.OP_STATE, :2] = OperationState.Idle
    assert bench.poll(1.1) == ""
    bench.engine.snapshot.flags[Flag.OP_STATE, :2] = OperationState.Intpl  # from now on its own
    stops = len(bench.named("Stop"))
    assert bench.poll(5.0) == ""
    assert len(bench.named("Stop")) == stops


@pytest.mark.parametrize(("found", "created"), [(1001, 1), (5000, 1), (1000, 2)])
def test_a_buffer_that_is_there_is_used_if_it_is_large_enough(bench: Bench, found: int, created: int) -> None:
    bench.engine.buffer_points = found
    bench.engine.codes["CreateSplineBuffer"] = [ALREADY]
    assert bench.poll() == ""
    assert len(bench.named("CreateSplineBuffer")) == created
    assert len(bench.named("FreeSplineBuffer")) == created - 1


def test_rejected_spline_buffer_is_retried_and_blocks_start(bench: Bench) -> None:
    bench.engine.codes["CreateSplineBuffer"] = [1552]
    assert "advanced 1552" in bench.poll()
    fault = bench.arm.start(SPLINE)
    assert fault is not None
    assert fault.code == CoreMotionErrorCode.ChannelBufferMemoryNotAllocated
    assert bench.named("Start") == []
    assert "ChannelOutOfRange" in bench.poll(0.5)
    assert bench.poll(0.6) == ""
    assert bench.arm.start(SPLINE) is None


def test_a_spline_becomes_rows_axes_and_milliseconds(bench: Bench) -> None:
    bench.poll()
    assert bench.arm.start(SPLINE) is None
    ((_, channel, command, count, points, times_ms),) = bench.named("Start")
    assert (channel, count, command.dimensionCount) == (0, 3, 2)
    assert [command.GetAxis(dimension) for dimension in range(2)] == [0, 1]
    assert [[point.GetPos(0), point.GetPos(1)] for point in points] == SPLINE.positions.tolist()
    assert times_ms == [0.0, 500.0, 1250.0]


def test_refusals_carry_the_code_and_the_text_of_their_module(bench: Bench) -> None:
    bench.poll()
    bench.engine.codes = {"Start": [94222], "Stop": [1566], "QuickStop": [1567], "SetOutBit": [1550]}
    for fault, code, words in (
        (bench.arm.start(SPLINE), 94222, "starting the spline: advanced 94222 (error 94222)"),
        (bench.arm.stop(), 1566, "stop: motion 1566 (error 1566)"),
        (bench.arm.quick_stop(), 1567, "quick stop: motion 1567 (error 1567)"),
        (bench.arm.set_output(9, 0, 1), 1550, "gripper output: io 1550 (error 1550)"),
    ):
        assert fault is not None
        assert (fault.code, fault.text) == (code, words)


def test_stops_name_the_joints_axes(bench: Bench) -> None:
    bench.poll()
    assert bench.arm.stop() is None
    assert bench.arm.quick_stop() is None
    for name in ("Stop", "QuickStop"):
        ((_, selection),) = bench.named(name)
        assert (selection.axisCount, [selection.GetAxis(0), selection.GetAxis(1)]) == (2, [0, 1])


def test_the_state_is_that_of_the_joints_alone(bench: Bench) -> None:
    bench.poll()
    bench.engine.snapshot.reals[Real.ACTUAL_POS] = [0.1, 0.2, 0.3]
    bench.engine.snapshot.flags[Flag.AMP_ALARM] = [0, 0, 1]
    state = bench.arm.read()
    assert isinstance(state, ArmState)
    assert state.position.tolist() == [0.1, 0.2]
    assert state.time_s == 7.0
    assert fault_of(state, ("a", "b")) is None
    bench.engine.snapshot.flags[Flag.AMP_ALARM] = [0, 1, 0]
    state = bench.arm.read()
    assert isinstance(state, ArmState)
    fault = fault_of(state, ("a", "b"))
    assert fault is not None
    assert (fault.code, fault.text) == (ErrorCode.AxisAmpAlarm, "b: amplifier alarm 0x0000")


def test_no_engine_a_stale_one_and_one_that_has_too_few_axes(bench: Bench) -> None:
    bench.absent = True
    assert bench.poll() == "waiting for the motion engine"
    for nothing in (bench.arm.read(),):
        assert isinstance(nothing, Blind)
        assert (nothing.gone, nothing.fault.code) == (True, ErrorCode.IMLibIsNotRunning)
    assert bench.arm.stop() is not None
    bench.absent = False
    assert bench.poll(0.2) == ""
    bench.engine.codes["read"] = [int(ErrorCode.StatusChannelError)]
    stale = bench.arm.read()
    assert isinstance(stale, Blind)
    assert (stale.gone, stale.fault.code) == (False, ErrorCode.StatusChannelError)
    bench.engine.snapshot = replace(empty_snapshot(1), engine_state=EngineState.Communicating)
    short = bench.arm.read()
    assert isinstance(short, Blind)
    assert short.fault.code == ErrorCode.AxisOutOfRange


def test_a_lost_device_is_given_up_and_a_new_one_gets_its_buffer(bench: Bench) -> None:
    bench.poll()
    bench.engine.codes["read"] = [int(ErrorCode.DeviceIsNull)]
    gone = bench.arm.read()
    assert isinstance(gone, Blind)
    assert (gone.gone, gone.fault.code) == (True, ErrorCode.DeviceIsNull)
    assert bench.engine.closed
    assert bench.poll(1.0) == ""
    assert len(bench.named("CreateSplineBuffer")) == 2


def test_an_output_counts_only_when_it_is_read_back_from_a_bus_that_runs(bench: Bench) -> None:
    bench.poll()
    assert bench.arm.set_output(0, 0, 1) is None
    assert bench.named("SetOutBit") == [("SetOutBit", 0, 0, 1)]
    bench.engine.output_sticks = False
    fault = bench.arm.set_output(0, 0, 0)
    assert fault is not None
    bench.engine.snapshot = replace(bench.engine.snapshot, engine_state=EngineState.Running)
    fault = bench.arm.set_output(0, 0, 1)
    assert fault is not None
    assert (fault.code, len(bench.named("SetOutBit"))) == (ErrorCode.CommNotStarted, 2)

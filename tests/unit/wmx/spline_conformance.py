"""Requirements for splines of any implementation of the engine port. Part of the conformance tests."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import (
    AdvancedMotionErrorCode,
    AdvMotion_PointTimeSplineCommand,
    AdvMotion_SplinePoint,
    AxisCommandMode,
    AxisSelection,
    CoreMotionErrorCode,
    DetailOperationState,
    ErrorCode,
    EStopLevel,
    Motion_PosCommand,
    OperationState,
    Profile,
)
from robot_stack.wmx.axes import Flag, Real, StatusSnapshot
from tests.unit.wmx.harness import (
    N_AXES,
    POS,
    POS_GEARED,
    POS_MIRRORED,
    POSITION_AXES,
    VEL,
    Harness,
    some_cycles,
    status,
    wait_idle,
    wait_status,
)
from tests.unit.wmx.spline_bench import clamped

GOOD = ErrorCode.PyNone
CHANNEL = 2
AXES = list(POSITION_AXES)
# Half a minute on a straight path: each axis at its own constant velocity, except at the ends.
VELOCITIES = np.array([2.0, -1.0, 0.5])
LONG_MS = [100.0 * tenth for tenth in range(1, 301)]
LONG_WAY = np.outer(np.arange(1.0, 301.0) * 0.1, VELOCITIES)
STRAIGHT = 3.0
"""Of axis POS. By then the curve of the start has decayed, by a factor of 3.7 per point."""


def spline(
    engine: MotionEngine,
    points: Any,
    times_ms: Sequence[float],
    axes: Sequence[int] = tuple(AXES),
    channel: int = CHANNEL,
) -> int:
    """Calls StartCSplinePos_PointTime; ``points`` has a row per point and a column per axis."""
    command = AdvMotion_PointTimeSplineCommand(dimensionCount=len(axes))
    for dimension, axis in enumerate(axes):
        command.SetAxis(dimension, axis)
    rows = []
    for position in np.array(points, np.float64).reshape(len(times_ms), len(axes)).tolist():
        row = AdvMotion_SplinePoint()
        for dimension, value in enumerate(position):
            row.SetPos(dimension, value)
        rows.append(row)
    start = _advanced(engine).StartCSplinePos_PointTime
    return start(channel, command, len(rows), rows, list(times_ms))


def start_of_one_axis(engine: MotionEngine, axis: int) -> int:
    """Starts a spline of one axis, and creates the buffer if there is none."""
    _advanced(engine).CreateSplineBuffer(CHANNEL, 10)
    return spline(engine, [[1.0]], [1000.0], [axis])


def _advanced(engine: MotionEngine) -> Any:
    return engine.advanced_motion.advMotion


def _ready(harness: Harness, name: str = "test") -> MotionEngine:
    engine = harness.ready(name)
    assert _advanced(engine).CreateSplineBuffer(CHANNEL, 1000) == GOOD
    return engine


def _moving(harness: Harness, name: str = "test", quick_stop: float = 4.0) -> MotionEngine:
    """Returns an engine with all position axes on the long path at full speed."""
    engine = _ready(harness, name)
    config = engine.core_motion.config
    for axis in AXES:
        _, param = config.GetMotionParam(axis)
        assert config.SetMotionParam(axis, replace(param, quickStopDec=quick_stop))[0] == GOOD
    assert spline(engine, LONG_WAY, LONG_MS) == GOOD
    wait_status(engine, lambda now: now.velocity_cmd[POS] > 1.9, "full speed")
    return engine


def _states(snapshot: StatusSnapshot) -> set[int]:
    return {int(snapshot.op_state[axis]) for axis in AXES}


def _at_rest(snapshot: StatusSnapshot) -> bool:
    return _states(snapshot) == {OperationState.Idle}


def _greatest_acceleration() -> float:
    """Returns the largest acceleration of the long path over all axes: it is linear between the points."""
    knots = 1e-3 * np.append(0.0, LONG_MS)
    return float(np.linalg.norm(clamped(LONG_WAY, np.asarray(LONG_MS))(knots, 2), axis=1).max())


def _assert_stopped_on_the_straight_way(engine: MotionEngine) -> None:
    """All axes are at rest, none completed, and the positions are still proportional to the velocities."""
    snapshot = wait_status(engine, _at_rest, "rest")
    assert not snapshot.motion_complete[AXES].any()
    assert STRAIGHT < snapshot.pos_cmd[POS] < LONG_WAY[-1, 0]
    assert snapshot.pos_cmd[AXES] == pytest.approx(snapshot.pos_cmd[POS] * VELOCITIES / 2.0, abs=1e-9)


NAN, INF = math.nan, math.inf
REFUSED: dict[str, tuple[dict[str, Any], int]] = {
    "axis twice": ({"axes": [POS, POS], "points": [[1, 1]]}, ErrorCode.DuplicateAxis),
    "no axis": ({"axes": [], "points": [[]]}, AdvancedMotionErrorCode.DimensionOutOfRange),
    "channel": ({"channel": 128}, ErrorCode.ChannelOutOfRange),
    "no buffer": ({"channel": 5}, CoreMotionErrorCode.ChannelBufferMemoryNotAllocated),
    "position nan": ({"points": [[NAN]]}, CoreMotionErrorCode.PositionArgumentOutOfRange),
    "position inf": ({"points": [[INF]]}, CoreMotionErrorCode.PositionArgumentOutOfRange),
    "time nan": ({"times_ms": [NAN]}, CoreMotionErrorCode.TimeArgumentOutOfRange),
    "time inf": ({"times_ms": [INF]}, CoreMotionErrorCode.TimeArgumentOutOfRange),
    "times too close": (
        {"points": [[1], [2]], "times_ms": [100.0, 100.0005]},
        AdvancedMotionErrorCode.TimeBetweenPointsTooClose,
    ),
    "no point": ({"points": [], "times_ms": []}, AdvancedMotionErrorCode.PointCountBelowMinimum),
    "already there": ({"points": [[0.5e-6]]}, AdvancedMotionErrorCode.PointCountBelowMinimum),
    "velocity mode": ({"axes": [VEL]}, CoreMotionErrorCode.NotPosMode),
}


class SplineCallConformance:
    """Needs: a fixture ``harness`` (Harness) with an idle engine."""

    def test_spline_buffers(self, harness: Harness) -> None:
        engine = harness.connect()
        advanced = _advanced(engine)
        none, already = (
            CoreMotionErrorCode.ChannelBufferMemoryNotAllocated,
            CoreMotionErrorCode.ChannelBufferMemoryAlreadyAllocated,
        )
        for channel in (0, 127):
            assert advanced.GetSplineBufferPoints(channel) == (none, 0)
            assert advanced.FreeSplineBuffer(channel) == none
            assert advanced.CreateSplineBuffer(channel, 20 + channel) == GOOD
            assert advanced.CreateSplineBuffer(channel, 30) == already
            assert advanced.GetSplineBufferPoints(channel) == (GOOD, 20 + channel)
            assert advanced.FreeSplineBuffer(channel) == GOOD
            assert advanced.GetSplineBufferPoints(channel) == (none, 0)
        for channel in (-1, 128):
            assert advanced.CreateSplineBuffer(channel, 10) == ErrorCode.ChannelOutOfRange
            assert advanced.FreeSplineBuffer(channel) == ErrorCode.ChannelOutOfRange
            assert advanced.GetSplineBufferPoints(channel) == (ErrorCode.ChannelOutOfRange, 0)

    def test_spline_buffers_outlive_devices_and_not_the_engine(self, harness: Harness) -> None:
        one, two = harness.connect("one"), harness.connect("two")
        assert _advanced(one).CreateSplineBuffer(CHANNEL, 10) == GOOD
        assert one.api.CloseDevice() == GOOD
        assert _advanced(two).GetSplineBufferPoints(CHANNEL) == (GOOD, 10)
        assert two.api.StopEngine(20000) == GOOD
        code, _ = _advanced(harness.connect("three")).GetSplineBufferPoints(CHANNEL)
        assert code == CoreMotionErrorCode.ChannelBufferMemoryNotAllocated

    def test_spline_runs_to_its_last_point(self, harness: Harness) -> None:
        engine = _ready(harness)
        points = [[0.2, 0.1, -0.3], [0.5, -0.4, 0.3], [1.0, -1.0, 0.5]]
        assert spline(engine, points, [500.0, 1250.0, 2000.0]) == GOOD
        snapshot = status(engine)
        assert _states(snapshot) == {OperationState.Intpl}
        assert snapshot.flags[Flag.DETAIL_OP_STATE, POS] == DetailOperationState.Intpl_Spline
        assert snapshot.op_state[VEL] == OperationState.Idle
        assert snapshot.reals[Real.PROFILE_TARGET_POS, AXES].tolist() == points[-1]
        assert 0.0 < snapshot.reals[Real.PROFILE_REMAINING_MS, POS] < 2000.0
        assert not snapshot.motion_complete[AXES].any()
        assert not snapshot.flags[Flag.CMD_DISTRIBUTION_END, AXES].any()
        wait_idle(engine, *AXES)
        snapshot = status(engine)
        assert snapshot.pos_cmd[AXES].tolist() == points[-1]
        assert snapshot.motion_complete[AXES].all()
        assert snapshot.flags[Flag.CMD_DISTRIBUTION_END, AXES].all()
        wait_status(engine, lambda now: np.abs(now.actual_pos[AXES] - points[-1]).max() < 1e-3, "the drives there")

    def test_spline_starts_where_the_command_is(self, harness: Harness) -> None:
        engine = _ready(harness)
        profile = Profile.SetupTrapezoidal(20.0, 400.0, 400.0)
        assert engine.core_motion.motion.StartPos(Motion_PosCommand(POS, 0.7, profile)) == GOOD
        wait_idle(engine, POS)
        assert spline(engine, [[0.0], [0.8]], [0.0, 60000.0], [POS]) == GOOD
        snapshot = some_cycles(engine)
        assert 0.7 <= snapshot.pos_cmd[POS] < 0.72
        assert engine.core_motion.motion.Stop(POS) == GOOD

    def test_spline_refused(self, harness: Harness) -> None:
        engine = _ready(harness)
        for name, (changes, code) in REFUSED.items():
            call: dict[str, Any] = {"axes": [POS], "points": [[1.0]], **changes}
            call.setdefault("times_ms", [100.0 * (k + 1) for k in range(len(call["points"]))])
            assert spline(engine, **call) == code, name
        start, point = _advanced(engine).StartCSplinePos_PointTime, AdvMotion_SplinePoint([1.0])
        command = AdvMotion_PointTimeSplineCommand(dimensionCount=7, axis=list(range(7)))
        assert start(CHANNEL, command, 1, [point], [9.0]) == AdvancedMotionErrorCode.DimensionOutOfRange
        command = AdvMotion_PointTimeSplineCommand(dimensionCount=1, axis=[POS])
        assert start(CHANNEL, command, 2, [point], [100.0, 200.0]) == ErrorCode.ArgumentOutOfRange
        assert start(CHANNEL, command, 2, [point, point], [100.0]) == ErrorCode.ArgumentOutOfRange
        assert _advanced(engine).CreateSplineBuffer(9, 2) == GOOD
        code = spline(engine, [[0.1], [0.2], [0.3]], [100.0, 200.0, 300.0], [POS], 9)
        assert code == CoreMotionErrorCode.ChannelNotEnoughSpace
        snapshot = some_cycles(engine)
        assert not snapshot.op_state.any()
        assert not snapshot.pos_cmd[AXES].any()

    def test_spline_in_a_wrong_state(self, harness: Harness) -> None:
        engine = _ready(harness)
        assert engine.core_motion.ExecEStop(EStopLevel.Level1) == GOOD
        assert spline(engine, LONG_WAY, LONG_MS) == CoreMotionErrorCode.EmergencyStopSignalOn
        assert engine.core_motion.ReleaseEStop() == GOOD
        profile = Profile.SetupTrapezoidal(2.0, 400.0, 400.0)
        assert engine.core_motion.motion.StartPos(Motion_PosCommand(POS_GEARED, 1000.0, profile)) == GOOD
        assert spline(engine, LONG_WAY, LONG_MS) == CoreMotionErrorCode.NotIdleOrIntplState
        engine.core_motion.axisControl.SetServoOn(POS_GEARED, 0)
        wait_status(engine, lambda now: not now.servo_on[POS_GEARED], "servo off")
        assert spline(engine, LONG_WAY, LONG_MS) == CoreMotionErrorCode.NotServoOn
        assert not some_cycles(engine).op_state.any()

    def test_commands_over_a_spline(self, harness: Harness) -> None:
        engine = _moving(harness)
        motion, control = engine.core_motion.motion, engine.core_motion.axisControl
        command = Motion_PosCommand(POS_MIRRORED, 1.0, Profile.SetupTrapezoidal(1.0, 10.0, 10.0))
        assert motion.StartPos(command) == CoreMotionErrorCode.NotIdleOrPosState
        assert motion.StartMov(command) == CoreMotionErrorCode.NotIdleOrPosState
        assert control.SetAxisCommandMode(POS, AxisCommandMode.Velocity) == ErrorCode.NotIdleState
        assert engine.core_motion.home.StartHome(POS) == ErrorCode.NotIdleState
        assert spline(engine, LONG_WAY, LONG_MS) == CoreMotionErrorCode.ChannelExecutingCommands
        assert _advanced(engine).FreeSplineBuffer(CHANNEL) == CoreMotionErrorCode.ChannelExecutingCommands
        assert _advanced(engine).CreateSplineBuffer(9, 10) == GOOD
        assert spline(engine, [[1.0]], [100.0], [POS], 9) == CoreMotionErrorCode.NotIdleOrIntplState
        assert _states(status(engine)) == {OperationState.Intpl}

    def test_texts_of_splines(self, harness: Harness) -> None:
        advanced = harness.connect().advanced_motion
        close = AdvancedMotionErrorCode.TimeBetweenPointsTooClose
        assert advanced.ErrorToString(close) not in ("", "error code not defined")
        assert advanced.ErrorToString(CoreMotionErrorCode.NotServoOn) == "the servo is not on"
        assert advanced.ErrorToString(123456789) == "error code not defined"


class SplineMotionConformance:
    """Needs: a fixture ``harness`` (Harness) with an idle engine."""

    def test_spline_of_a_thousand_points(self, harness: Harness) -> None:
        engine = _ready(harness)
        angle = np.linspace(0.0, 2.0, 1000)
        points = np.column_stack((np.sin(angle), 1.0 - np.cos(angle), 0.3 * angle))
        assert spline(engine, points, np.linspace(0.0, 2000.0, 1000).tolist()) == GOOD
        wait_idle(engine, POS)
        assert status(engine).pos_cmd[AXES].tolist() == points[-1].tolist()

    @pytest.mark.parametrize("name", ["Stop", "Stop_AxisSel", "ExecQuickStop"])
    def test_stop_of_one_axis_stops_all_along_the_path(self, harness: Harness, name: str) -> None:
        engine = _moving(harness)
        wait_status(engine, lambda now: now.pos_cmd[POS] > STRAIGHT, "the straight part")
        stop = getattr(engine.core_motion.motion, name)
        arguments: dict[str, list[Any]] = {
            "Stop_AxisSel": [AxisSelection.of(*AXES)],
        }
        assert stop(*arguments.get(name, [POS_GEARED])) == GOOD
        snapshot = status(engine)
        assert _states(snapshot) == {OperationState.Stop}
        if name in ("Stop", "Stop_AxisSel"):  # the fastest axis, with the largest acceleration of all axes together
            assert snapshot.reals[Real.CMD_ACC, POS] == pytest.approx(-_greatest_acceleration(), rel=1e-3)
        else:  # 2 rad/s at 4 rad/s2
            assert snapshot.reals[Real.CMD_ACC, POS] == pytest.approx(-4.0, rel=1e-3)
        _assert_stopped_on_the_straight_way(engine)
        wait_idle(engine, POS)

    def test_quick_stop_of_a_spline_is_not_softened(self, harness: Harness) -> None:
        engine = _moving(harness)
        motion = engine.core_motion.motion
        assert motion.ExecQuickStop(POS_MIRRORED) == GOOD
        assert motion.Stop(POS) == GOOD
        assert status(engine).flags[Flag.DETAIL_OP_STATE, POS_GEARED] == DetailOperationState.Stop_QStop
        wait_status(engine, _at_rest, "rest")

    def test_servo_off_of_one_axis_stops_the_others(self, harness: Harness) -> None:
        engine = _moving(harness)
        assert engine.core_motion.axisControl.SetServoOn(POS_MIRRORED, 0) == GOOD
        snapshot = wait_status(engine, _at_rest, "rest")
        assert not snapshot.motion_complete[AXES].any()
        assert snapshot.servo_on[[POS, POS_GEARED]].all()

    @pytest.mark.parametrize("level", list(EStopLevel))
    def test_estop_of_a_spline(self, harness: Harness, level: EStopLevel) -> None:
        engine = _moving(harness)
        assert engine.core_motion.ExecEStop(level) == GOOD
        snapshot = wait_status(engine, _at_rest, "rest")
        assert not snapshot.motion_complete[AXES].any()
        if level is EStopLevel.Final:
            wait_status(engine, lambda now: not now.servo_on.any(), "servos off")
        else:
            assert snapshot.servo_on.all()

    def test_closing_the_device_leaves_its_spline_to_its_end(self, harness: Harness) -> None:
        other = harness.connect("other")
        engine = _moving(harness, "one")
        wait_status(engine, lambda now: now.pos_cmd[POS] > STRAIGHT, "the straight part")
        assert engine.api.CloseDevice() == GOOD
        before = status(other)
        after = wait_status(other, lambda now: now.cycle_counter > before.cycle_counter + 50, "some cycles")
        assert _states(after) == {OperationState.Intpl}
        assert after.pos_cmd[POS] > before.pos_cmd[POS]

    def test_stop_communication_during_a_spline(self, harness: Harness) -> None:
        engine = _moving(harness)
        assert engine.api.StopCommunication(20000) == GOOD
        before = status(engine)
        assert _at_rest(before)
        assert not before.servo_on.any()
        assert not before.motion_complete[AXES].any()
        assert some_cycles(engine).pos_cmd[AXES].tolist() == before.pos_cmd[AXES].tolist()
        assert engine.api.StartCommunication(20000) == GOOD
        assert engine.core_motion.axisControl.SetServoOn_AxisSel(AxisSelection.of(*range(N_AXES)), 1) == GOOD
        wait_status(engine, lambda now: now.servo_on.all(), "servos on")
        assert spline(engine, [[0.0, 0.0, 0.0]], [100.0]) == GOOD, "the channel is free again"

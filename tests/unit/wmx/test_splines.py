"""Splines of the engine, cycle by cycle: the curve against another implementation, rejections, stops, faults."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.wmx.api import (
    AdvancedMotionErrorCode,
    AxisCommandMode,
    CoreMotionErrorCode,
    DetailOperationState,
    ErrorCode,
    EStopLevel,
    OperationState,
)
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.engine_server import spline_kernel
from robot_stack.wmx.engine_server.requests import Session, execute
from robot_stack.wmx.simulated.protocol import pack, unpack
from tests.unit.wmx.spline_bench import (
    AXES,
    CHANNEL,
    CYCLE_S,
    ESTOP_DEC,
    N_ARM,
    QUICK_DEC,
    WAY,
    WAY_MS,
    Arm,
    clamped,
    off_path,
)

GOOD = ErrorCode.PyNone
POSITION = AxisCommandMode.Position
WAY_S = 2.0


@pytest.fixture
def arm() -> Arm:
    return Arm()


@pytest.fixture(scope="module")
def shared() -> Arm:
    """One arm for requests that change nothing."""
    return Arm()


class TestCurve:
    @settings(max_examples=40, deadline=None)
    @given(st.integers(1, 40), st.integers(1, 6), st.integers(0, 2**32 - 1))
    def test_any_curve_against_another_implementation(self, n: int, d: int, seed: int) -> None:
        random = np.random.default_rng(seed)
        times = np.concatenate(([0.0], np.cumsum(random.uniform(1e-3, 2.0, n))))
        points = random.uniform(-3.0, 3.0, (n + 1, d))
        curve = np.empty((n, d, 4))
        farthest = spline_kernel.plan_spline(times, points, curve)
        other = clamped(points[1:], times[1:] * 1e3, points[0])
        # Both are in power basis: coefficients of short segments are large, hence a relative comparison.
        scale = np.abs(other.c).max(axis=(1, 2))[::-1]
        assert np.abs(curve.transpose(2, 0, 1)[::-1] - other.c).max(axis=(1, 2))[::-1] == pytest.approx(
            0.0, abs=1e-8 * scale.max()
        )
        fine = other(np.linspace(0.0, times[-1], 2000))
        assert np.abs(fine).max() <= farthest * (1.0 + 1e-9)

    def test_every_cycle_against_another_implementation(self, arm: Arm) -> None:
        other = clamped(WAY, WAY_MS)
        assert arm.start() == GOOD
        for cycle in range(1, 2000):
            arm.step()
            t = cycle * CYCLE_S
            assert arm.position == pytest.approx(other(t), abs=1e-12)
            assert arm.velocity == pytest.approx(other(t, 1), abs=1e-11)
            assert arm.real(Real.CMD_ACC) == pytest.approx(other(t, 2), abs=1e-9)

    @settings(max_examples=25, deadline=None)
    @given(st.data())
    def test_continuous_bounded_and_exact_at_the_end(self, data: st.DataObject) -> None:
        """The position moves no faster than the curve, and ends exactly on the last point."""
        arm = _rested()
        n = data.draw(st.integers(1, 6))
        axes = data.draw(st.permutations(AXES))[: data.draw(st.integers(1, N_ARM))]
        gaps = data.draw(st.lists(st.floats(1.0, 80.0), min_size=n, max_size=n))
        numbers = st.floats(-3.0, 3.0)
        points = [data.draw(st.lists(numbers, min_size=len(axes), max_size=len(axes))) for _ in range(n)]
        times = np.cumsum(gaps).tolist()
        start = arm.position[axes]
        steps = np.abs(np.diff(np.vstack((start, points)), axis=0)).max(axis=1)
        if (steps < 1e-5).any():
            return  # points too close together are dropped, which another test covers
        other = clamped(points, times, start)
        fastest = np.abs(other(np.linspace(0.0, times[-1] * 1e-3, 4000), 1)).max(axis=0)
        assert arm.start(points, times, axes) == GOOD
        cycles = 0
        while not arm.engine.at_rest:
            before = arm.position[axes]
            arm.step()
            cycles += 1
            moved = np.abs(arm.position[axes] - before)
            assert (moved <= fastest * CYCLE_S * 1.01 + 1e-9).all()
            assert (np.abs(arm.velocity[axes]) <= fastest * 1.01 + 1e-9).all()
        assert arm.position[axes].tolist() == list(points[-1])
        assert cycles == math.ceil(round(times[-1], 6))

    @pytest.mark.parametrize("first", [0.0, 123.0], ids=["present position", "anywhere"])
    def test_first_point_at_time_zero_is_passed_over(self, arm: Arm, first: float) -> None:
        assert arm.start([[first], [1.0]], [0.0, 1000.0], axes=[0]) == GOOD
        arm.step(500)
        assert arm.position[0] == pytest.approx(0.5, abs=1e-12)

    @pytest.mark.parametrize(
        ("points", "times", "counted", "counted_times"),
        [
            ([0.9e-6, 1.0], [300.0, 1000.0], [1.0], [1000.0]),
            ([0.5, 0.5 + 0.9e-6, 1.0], [300.0, 600.0, 1000.0], [0.5, 1.0], [300.0, 1000.0]),
            ([0.5, 1.0, 1.0], [300.0, 600.0, 1000.0], [0.5, 1.0], [300.0, 600.0]),
            ([0.6e-6, 1.2e-6, 1.0], [300.0, 600.0, 1000.0], [1.2e-6, 1.0], [600.0, 1000.0]),
        ],
        ids=["as the start", "in the middle", "at the end", "compared with the one kept"],
    )
    def test_of_points_too_close_the_later_is_dropped(
        self, arm: Arm, points: list[float], times: list[float], counted: list[float], counted_times: list[float]
    ) -> None:
        other = clamped(counted, counted_times)
        assert arm.start(points, times, axes=[0]) == GOOD
        for cycle in range(1, int(counted_times[-1])):
            arm.step()
            assert arm.position[0] == pytest.approx(float(other(cycle * CYCLE_S)[0]), abs=1e-12)
        arm.step()
        assert arm.engine.at_rest

    def test_points_close_in_one_dimension_only_count(self, arm: Arm) -> None:
        assert arm.start([[0.5, 0.5], [0.5, 0.7]], [100.0, 200.0], axes=[0, 1]) == GOOD
        arm.step(199)
        assert arm.states == {OperationState.Idle, OperationState.Intpl}


class TestStatus:
    def test_to_the_cycle(self, arm: Arm) -> None:
        assert arm.start([[1.0, -1.0]], [100.0], axes=[4, 1]) == GOOD
        for cycle in range(1, 100):
            arm.step()
            for axis in (1, 4):
                assert arm.flag(Flag.OP_STATE)[axis] == OperationState.Intpl
                assert arm.flag(Flag.DETAIL_OP_STATE)[axis] == DetailOperationState.Intpl_Spline
                assert not arm.flag(Flag.MOTION_COMPLETE)[axis]
                assert not arm.flag(Flag.CMD_DISTRIBUTION_END)[axis]
                assert arm.real(Real.PROFILE_REMAINING_MS)[axis] == pytest.approx(100.0 - cycle)
            assert arm.real(Real.PROFILE_TARGET_POS)[[1, 4]].tolist() == [-1.0, 1.0]
            assert not arm.flag(Flag.POS_SET)[1]
        arm.step()
        for axis in (1, 4):
            assert arm.flag(Flag.OP_STATE)[axis] == OperationState.Idle
            assert arm.flag(Flag.DETAIL_OP_STATE)[axis] == DetailOperationState.Idle
            assert arm.flag(Flag.MOTION_COMPLETE)[axis]
            assert arm.flag(Flag.CMD_DISTRIBUTION_END)[axis]
            assert arm.real(Real.PROFILE_REMAINING_MS)[axis] == 0.0
            assert arm.real(Real.CMD_ACC)[axis] == 0.0
            assert arm.flag(Flag.END_REASON)[axis] == GOOD
        arm.step(60)
        assert arm.flag(Flag.IN_POS).all()
        assert arm.flag(Flag.POS_SET)[[1, 4]].all()

    def test_ends_between_cycles_in_the_next(self, arm: Arm) -> None:
        assert arm.start([[1.0]], [10.4], axes=[0]) == GOOD
        arm.step(10)
        assert not arm.engine.at_rest
        arm.step()
        assert arm.engine.at_rest
        assert arm.position[0] == 1.0

    def test_ready_for_the_next_command_while_it_runs(self, arm: Arm) -> None:
        arm.moving()
        assert arm.flag(Flag.COMMAND_READY).all()
        assert set(arm.flag(Flag.OWNER)) == {arm.device}


class TestBuffers:
    @pytest.mark.parametrize("points", [0, -1, -(10**9)])
    def test_without_points(self, shared: Arm, points: int) -> None:
        assert shared.splines.create(9, points) == ErrorCode.ArgumentOutOfRange
        assert shared.splines.points(9)[0] == CoreMotionErrorCode.ChannelBufferMemoryNotAllocated

    def test_larger_than_there_is_memory_for(self, shared: Arm) -> None:
        assert shared.splines.create(9, 10**9) == CoreMotionErrorCode.ChannelBufferMemoryFailedToAllocate

    def test_two_channels_at_once(self, arm: Arm) -> None:
        assert arm.splines.create(0, 10) == GOOD
        assert arm.start([[1.0, 2.0]], [100.0], axes=[0, 1]) == GOOD
        arm.step(50)
        assert arm.start([[1.0, 2.0]], [100.0], axes=[2, 3], channel=0) == GOOD
        arm.step(50)
        assert arm.position[:4] == pytest.approx([1.0, 2.0, 0.5, 1.0])
        assert arm.flag(Flag.OP_STATE)[:4].tolist() == [0, 0, OperationState.Intpl, OperationState.Intpl]
        arm.step(50)
        assert arm.position[:4].tolist() == [1.0, 2.0, 1.0, 2.0]


NAN, INF = math.nan, math.inf
REFUSED: dict[str, tuple[dict[str, Any], int]] = {
    "axis -1": ({"axes": [0, -1], "points": [[1, 1]]}, ErrorCode.AxisOutOfRange),
    "axis 6": ({"axes": [6], "points": [[1]]}, ErrorCode.AxisOutOfRange),
    "buffer too small": ({"channel": 4, "points": [[1], [2], [3]]}, CoreMotionErrorCode.ChannelNotEnoughSpace),
    "position without exact counts": ({"points": [[1e10]]}, CoreMotionErrorCode.PositionArgumentOutOfRange),
    "overshoot without exact counts": (
        {"points": [[1.0], [1e6], [1e6 + 1]], "times_ms": [1.0, 1.001, 1e9]},
        CoreMotionErrorCode.PositionArgumentOutOfRange,
    ),
    "time negative": ({"times_ms": [-1.0]}, CoreMotionErrorCode.TimeArgumentOutOfRange),
    "time too large": ({"times_ms": [1e12]}, CoreMotionErrorCode.TimeArgumentOutOfRange),
    "times descend": (
        {"points": [[1], [2]], "times_ms": [200.0, 100.0]},
        AdvancedMotionErrorCode.TimeBetweenPointsTooClose,
    ),
    "times equal": (
        {"points": [[1], [2]], "times_ms": [100.0, 100.0]},
        AdvancedMotionErrorCode.TimeBetweenPointsTooClose,
    ),
    "time too close to the start": ({"times_ms": [0.0009]}, AdvancedMotionErrorCode.TimeBetweenPointsTooClose),
    "start alone": ({"points": [[1.0]], "times_ms": [0.0]}, AdvancedMotionErrorCode.PointCountBelowMinimum),
}


class TestRefusals:
    def test_arguments(self, arm: Arm) -> None:
        arm.splines.create(4, 2)
        for name, (changes, code) in REFUSED.items():
            call: dict[str, Any] = {"axes": [0], "points": [[1.0]], **changes}
            call.setdefault("times_ms", [100.0 * (k + 1) for k in range(len(call["points"]))])
            assert arm.start(**call) == code, name
            arm.step(3)
            assert arm.engine.at_rest
            assert not arm.position.any()
        assert arm.start([[1.0]], [100.0], axes=[0]) == GOOD, "nothing of the refused ones is left"

    def test_closest_times_allowed(self, arm: Arm) -> None:
        assert arm.start([[1.0], [1.001]], [1000.0, 1000.001], axes=[0]) == GOOD

    def test_without_communication(self, arm: Arm) -> None:
        arm.engine.stop_communication()
        assert arm.start() == ErrorCode.CommNotStarted

    def test_alarm_of_one_axis(self, arm: Arm) -> None:
        arm.drives.alarms[4] = 17
        arm.step(3)
        assert arm.start() == ErrorCode.AxisAmpAlarm
        assert arm.start([[1.0]], [100.0], axes=[0]) == GOOD

    def test_further_into_a_soft_limit(self) -> None:
        arm = Arm(soft_limits={"negative_rad": -1.0, "positive_rad": 1.0, "dec_radps2": 100.0}, absolute_encoder=True)
        assert arm.start([[1.5]], [1000.0], axes=[0]) == GOOD
        arm.at_rest()
        assert arm.flag(Flag.POSITIVE_SOFT_LIMIT)[0]
        assert arm.start([[1.6]], [1000.0], axes=[0]) == ErrorCode.AxisSoftLimit
        assert arm.start([[0.5]], [1000.0], axes=[0]) == GOOD


_RESTED: list[Arm] = []


def _rested() -> Arm:
    """Returns one arm for all examples of a property, at rest."""
    if not _RESTED:
        _RESTED.append(Arm())
    arm = _RESTED[0]
    for axis in AXES:
        arm.motion.quick_stop_axis(axis)
    arm.at_rest()
    return arm


Stop = Callable[[Arm, int], int]
STOPS: dict[str, Stop] = {
    "Stop": lambda arm, axis: arm.motion.stop([axis], POSITION),
    "Stop_AxisSel": lambda arm, axis: arm.motion.stop(AXES, POSITION),
    "ExecQuickStop": lambda arm, axis: arm.motion.quick_stop([axis], POSITION),
    "ExecQuickStop_AxisSel": lambda arm, axis: arm.motion.quick_stop(AXES, POSITION),
}


class TestStops:
    @pytest.mark.parametrize("stop", list(STOPS.values()), ids=list(STOPS))
    def test_all_axes_come_to_rest_on_the_path(self, arm: Arm, stop: Stop) -> None:
        curve = clamped(WAY, WAY_MS)
        arm.moving()
        assert stop(arm, 5) == GOOD
        assert arm.states == {OperationState.Stop}
        before = arm.velocity
        while not arm.engine.at_rest:
            arm.step()
            assert off_path(curve, arm.position, WAY_S) < 1e-9
            after = arm.velocity
            assert (np.abs(after - before) <= QUICK_DEC * CYCLE_S * 1.05).all()
            assert len(arm.states) == 1, "one path time: all axes stop in the same cycle"
            before = after
        assert not arm.flag(Flag.MOTION_COMPLETE).any()
        assert arm.flag(Flag.CMD_DISTRIBUTION_END).all()
        assert not arm.real(Real.PROFILE_REMAINING_MS).any()
        assert arm.real(Real.PROFILE_TARGET_POS).tolist() == arm.position.tolist()
        assert curve(0.9)[0] < arm.position[0] < WAY[-1, 0]
        arm.step(60)
        assert arm.real(Real.ACTUAL_POS) == pytest.approx(arm.position, abs=1e-4)
        assert arm.start() == GOOD, "ready for the next"

    def test_a_gentle_spline_is_stopped_gently(self) -> None:
        """With the largest acceleration of the spline over all axes, not with the quick-stop deceleration."""
        arm = Arm()
        times_ms = [4.0 * time_ms for time_ms in WAY_MS]
        greatest = np.linalg.norm(clamped(WAY, times_ms)(1e-3 * np.append(0.0, times_ms), 2), axis=1).max()
        assert greatest < 0.5 * QUICK_DEC
        assert arm.start(WAY, times_ms) == GOOD
        arm.step(3000)
        speed = np.abs(arm.velocity).max()
        arm.motion.stop([3], POSITION)
        hardest, before = 0.0, arm.velocity
        cycles = 0
        while not arm.engine.at_rest:
            arm.step()
            cycles += 1
            hardest = max(hardest, float(np.abs(arm.velocity - before).max()) / CYCLE_S)
            before = arm.velocity
        assert hardest <= 1.05 * greatest
        assert cycles * CYCLE_S >= 0.9 * speed / greatest

    @settings(max_examples=25, deadline=None)
    @given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0), st.sampled_from(["Stop", "ExecQuickStop"]))
    def test_bounded_in_time_and_deceleration_wherever_it_begins(self, seed: int, when: float, name: str) -> None:
        """The two guarantees of the spline kernel, on curves without limits of their own."""
        arm = _rested()
        random = np.random.default_rng(seed)
        n = int(random.integers(2, 9))
        times = np.cumsum(random.uniform(30.0, 200.0, n))
        points = arm.position + np.cumsum(random.normal(0.0, 0.2, (n, N_ARM)), axis=0)
        curve = clamped(points, times, arm.position)
        assert arm.start(points, times) == GOOD
        arm.step(int(when * (times[-1] - 1.0)))
        if arm.engine.at_rest:
            return
        begin = arm.engine.condition.cycles
        fine = np.linspace(0.0, times[-1] * 1e-3, 3000)
        knots = 1e-3 * np.append(0.0, times)
        bound = QUICK_DEC if name == "ExecQuickStop" else np.linalg.norm(curve(knots, 2), axis=1).max()
        slowest_s = 2.0 * np.abs(curve(fine, 1)).max() / bound
        own = np.abs(curve(fine, 2)).max(axis=0)
        allowed = np.maximum(bound, own + 0.5 * bound)
        STOPS[name](arm, int(random.integers(N_ARM)))
        before = arm.velocity
        while not arm.engine.at_rest:
            arm.step()
            after = arm.velocity
            assert (np.abs(after - before) <= allowed * CYCLE_S * 1.05 + 1e-9).all()
            before = after
        assert (arm.engine.condition.cycles - begin) * CYCLE_S <= slowest_s + 2.0 * CYCLE_S
        assert not arm.flag(Flag.MOTION_COMPLETE).any()

    def test_quick_stop_overrides_a_stop_and_not_the_reverse(self, arm: Arm) -> None:
        arm.moving()
        arm.soft_stop()
        arm.step(10)
        arm.motion.quick_stop([3], POSITION)
        assert set(arm.flag(Flag.DETAIL_OP_STATE)) == {DetailOperationState.Stop_QStop}
        arm.soft_stop()
        arm.motion.stop(AXES, POSITION)
        assert arm.at_rest() < 200

    def test_gentle_deceleration_of_one_axis_is_that_of_all(self, arm: Arm) -> None:
        arm.moving()
        arm.soft_stop(1, 4.0)
        before = arm.velocity
        while not arm.engine.at_rest:
            arm.step()
            assert abs(arm.velocity[1] - before[1]) <= 4.0 * CYCLE_S * 1.05
            before = arm.velocity

    def test_before_the_first_cycle(self, arm: Arm) -> None:
        assert arm.start() == GOOD
        arm.motion.stop([0], POSITION)
        arm.step()
        assert arm.engine.at_rest
        assert arm.position == pytest.approx(np.zeros(N_ARM), abs=1e-6)

    def test_leaves_another_spline_alone(self, arm: Arm) -> None:
        arm.splines.create(0, 10)
        assert arm.start([[1.0, 1.0]], [400.0], axes=[0, 1]) == GOOD
        assert arm.start([[1.0, 1.0]], [400.0], axes=[2, 3], channel=0) == GOOD
        arm.step(100)
        arm.motion.quick_stop([0], POSITION)
        arm.step(300)
        assert arm.position[:2].max() < 1.0
        assert arm.position[2:4].tolist() == [1.0, 1.0]
        assert arm.flag(Flag.MOTION_COMPLETE)[:4].tolist() == [0, 0, 1, 1]


class TestFaults:
    """One axis leaves the path, the others stop along it."""

    OTHERS: tuple[int, ...] = (0, 1, 3, 4, 5)

    def others_stop(self, arm: Arm, reason: int) -> None:
        curve = clamped(WAY, WAY_MS)
        others = list(self.OTHERS)
        start = arm.engine.condition.cycles
        assert set(arm.flag(Flag.OP_STATE)[others]) == {OperationState.Stop}
        assert set(arm.flag(Flag.DETAIL_OP_STATE)[others]) == {DetailOperationState.Stop_QStop}
        before = arm.velocity
        while arm.flag(Flag.OP_STATE)[others].any():
            arm.step()
            assert off_path(curve, arm.position, WAY_S, others) < 1e-9
            change = np.abs(arm.velocity - before)[others]
            assert (change <= QUICK_DEC * CYCLE_S * 1.05).all()
            before = arm.velocity
        assert (arm.engine.condition.cycles - start) * CYCLE_S < 0.25
        assert not arm.flag(Flag.MOTION_COMPLETE).any()
        assert set(arm.flag(Flag.END_REASON)[others]) == {reason}
        arm.at_rest()

    def test_alarm(self, arm: Arm) -> None:
        arm.moving()
        arm.drives.alarms[2] = 99
        arm.step()
        assert arm.flag(Flag.OP_STATE)[2] == OperationState.Idle
        self.others_stop(arm, ErrorCode.AxisAmpAlarm)

    def test_servo_drops_out(self, arm: Arm) -> None:
        arm.moving()
        arm.drives.broken[2] = True
        arm.step()
        assert arm.flag(Flag.OP_STATE)[2] == OperationState.Idle
        self.others_stop(arm, ErrorCode.ServoOff)

    def test_following_error(self) -> None:
        error = {
            "moving_rad": 0.02,
            "stopped_rad": 0.0,
            "velocity_moving_radps": 0.0,
            "velocity_stopped_radps": 0.0,
            "velocity_time_s": 0.0,
            "quick_stop": True,
        }
        arm = Arm(following_error=error).moving()
        arm.drives.frozen[2] = True
        arm.until(lambda: arm.flag(Flag.FOLLOWING_ERROR_ALARM)[2], 100)
        self.others_stop(arm, ErrorCode.AxisAmpAlarm)

    def test_soft_limit(self) -> None:
        limits = {"negative_rad": -5.0, "positive_rad": 1.0, "dec_radps2": 100.0}
        arm = Arm(soft_limits=limits, absolute_encoder=True)
        assert arm.start() == GOOD
        arm.until(lambda: arm.states != {OperationState.Intpl})
        axis = int(np.argmax(arm.flag(Flag.POSITIVE_SOFT_LIMIT)))
        assert axis == 0, "the first to get there"
        assert (arm.flag(Flag.OP_STATE) == OperationState.Stop).all()
        assert arm.flag(Flag.DETAIL_OP_STATE).tolist() == [DetailOperationState.Stop] + 5 * [
            DetailOperationState.Stop_QStop
        ]
        speed, position = arm.velocity[0], arm.position[0]
        arm.at_rest()
        assert arm.position[0] - position <= speed**2 / 200.0 + 1e-3
        assert set(arm.flag(Flag.END_REASON)) == {ErrorCode.AxisSoftLimit}
        assert not arm.flag(Flag.MOTION_COMPLETE).any()

    def test_fault_hastens_a_gentle_stop(self, arm: Arm) -> None:
        arm.moving()
        arm.soft_stop()
        arm.step(3)
        arm.drives.alarms[2] = 99
        arm.step()
        self.others_stop(arm, ErrorCode.AxisAmpAlarm)

    def test_all_axes_fault_at_once(self, arm: Arm) -> None:
        arm.moving()
        arm.drives.alarms[:] = 1
        arm.step(2)
        assert arm.engine.at_rest
        assert not arm.velocity.any()
        arm.drives.alarms[:] = 0
        arm.step()
        arm.engine.set_servo_on(AXES, 1)
        arm.step(20)
        assert arm.start() == GOOD, "the channel is free"

    @pytest.mark.parametrize(
        ("cycles", "level"), [(1, EStopLevel.Level1), (900, EStopLevel.Final), (1900, EStopLevel.Level1)]
    )
    def test_emergency_stop(self, arm: Arm, cycles: int, level: EStopLevel) -> None:
        assert arm.start() == GOOD
        arm.step(cycles)
        speed = np.abs(arm.velocity).max()
        assert arm.engine.exec_estop(level) == GOOD
        for _ in range(math.ceil(speed / ESTOP_DEC / CYCLE_S) + 2):
            before = np.abs(arm.velocity)
            arm.soft_stop()
            arm.step()
            assert (np.abs(arm.velocity) <= np.maximum(before - ESTOP_DEC * CYCLE_S, 0.0) + 1e-9).all()
        assert arm.engine.at_rest
        assert not arm.flag(Flag.MOTION_COMPLETE).any()
        arm.step(20)
        assert arm.flag(Flag.SERVO_ON).all() == (level is EStopLevel.Level1)
        arm.engine.release_estop()
        arm.step(20)
        assert arm.engine.at_rest, "nothing moves by the release"

    def test_emergency_stop_during_a_stop(self, arm: Arm) -> None:
        arm.moving()
        arm.soft_stop()
        arm.step(10)
        arm.engine.exec_estop(EStopLevel.Level1)
        before = np.abs(arm.velocity)
        arm.step()
        assert (np.abs(arm.velocity) <= np.maximum(before - ESTOP_DEC * CYCLE_S, 0.0) + 1e-9).all()
        assert arm.at_rest() < 100

    def test_bus_lost(self, arm: Arm) -> None:
        arm.moving()
        arm.drives.connected = False
        arm.step(25)
        assert not arm.engine.condition.communicating
        assert arm.engine.at_rest
        assert set(arm.flag(Flag.END_REASON)) == {ErrorCode.ServoOffline}

    def test_stop_engine(self, arm: Arm) -> None:
        arm.moving()
        arm.engine.stop_engine()
        arm.step(10)
        assert arm.engine.at_rest
        assert arm.engine.start_engine() == GOOD


class TestWire:
    def test_numbers_survive_exactly(self) -> None:
        numbers = [0.1, -1e300, math.nan, math.inf, 5e-324]
        assert unpack(pack(numbers)).tobytes() == np.array(numbers).tobytes()
        assert unpack(pack([])).size == 0

    @pytest.mark.parametrize("text", ["%", "AAAA", "AAAAAAAAAAA", "é", "AAAAAAAAAAA=AAAA"])
    def test_other_text_is_refused(self, text: str) -> None:
        with pytest.raises(ValueError, match="must be base64 of float64"):
            unpack(text)

    @pytest.mark.parametrize(
        "arguments",
        [
            [CHANNEL, [0], pack([1.0, 2.0]), pack([100.0])],
            [CHANNEL, [0, 1], pack([1.0, 2.0, 3.0]), pack([100.0])],
            [CHANNEL, [0], [[1.0]], [100.0]],
            [CHANNEL, [0], pack([1.0]), "AA"],
            ["0", [0], pack([1.0]), pack([100.0])],
        ],
    )
    def test_requests_that_are_none(self, shared: Arm, arguments: list[Any]) -> None:
        answer = execute(shared.engine, Session(shared.device), "StartSpline", arguments)
        assert answer == (ErrorCode.ArgumentOutOfRange, [])

    @settings(max_examples=40, deadline=None)
    @given(st.data())
    def test_any_numbers(self, data: st.DataObject) -> None:
        """For any points and times: an answer, and a finite state, in motion and during the stop."""
        arm = _rested()
        if arm.splines.points(CHANNEL)[0]:
            arm.splines.create(CHANNEL, 1000)
        n, d = data.draw(st.integers(0, 5)), data.draw(st.integers(1, 3))
        number = st.floats() | st.floats(-1e8, 1e8) | st.floats(-10.0, 10.0)
        time = st.floats(0.0, 1e4) | st.floats(0.0, 1e11) | st.floats()
        points = data.draw(st.lists(number, min_size=n * d, max_size=n * d))
        times = data.draw(st.lists(time, min_size=n, max_size=n))
        if data.draw(st.booleans()):
            times.sort()
        arguments = [CHANNEL, AXES[:d], pack(points), pack(times)]
        code, _ = execute(arm.engine, Session(arm.device), "StartSpline", arguments)
        for _ in range(5):
            arm.step()
            assert np.isfinite(arm.engine.arrays.reals).all()
        if code == GOOD:
            arm.motion.stop([0], POSITION)
            arm.step(30)
            assert np.isfinite(arm.engine.arrays.reals).all()
        if np.abs(arm.position).max() > 100.0:
            _RESTED.clear()  # too far away to start other examples

    def test_request(self, arm: Arm) -> None:
        arguments = [CHANNEL, [0, 1], pack([[1.0, 2.0], [3.0, 4.0]]), pack([100.0, 200.0])]
        assert execute(arm.engine, Session(arm.device), "StartSpline", arguments) == (GOOD, [])
        arm.step(200)
        assert arm.position[:2].tolist() == [3.0, 4.0]


def test_nothing_is_compiled_once_the_engine_is_up(arm: Arm) -> None:
    compiled = [function for function in vars(spline_kernel).values() if hasattr(function, "signatures")]
    before = [len(function.signatures) for function in compiled]
    assert sum(before) >= 3, "those that are called from outside"
    random = np.random.default_rng(1)
    for count in (1, 2, 50):
        times = np.cumsum(random.uniform(1.0, 3.0, count))
        assert arm.start(random.uniform(-0.1, 0.1, (count, N_ARM)), times) == GOOD
        arm.at_rest()
    for stop in STOPS.values():
        arm.start(np.ones((1, N_ARM)) * random.uniform(), [300.0])
        arm.step(100)
        stop(arm, 1)
        arm.at_rest()
    assert [len(function.signatures) for function in compiled] == before

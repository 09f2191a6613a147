"""Homing: where each type finds home, what interrupts it, and the state afterwards."""

from __future__ import annotations

import pytest

from robot_stack.wmx.api import (
    AxisCommandMode,
    Config_HomeDirection,
    Config_HomeType,
    Config_LimitSwitchType,
    CoreMotionErrorCode,
    ErrorCode,
    EStopLevel,
    HomeError,
    HomeState,
    OperationState,
)
from robot_stack.wmx.axes import Flag, Real
from tests.unit.wmx.harness import POS, POS_MIRRORED, VEL
from tests.unit.wmx.machine import ACC, FAST, Machine

Type = Config_HomeType
CYCLE_M = 2.0 * FAST * 0.001  # two cycles of the bus at the fast speed


def home(bench: Machine, axis: int = POS) -> list[int]:
    """Starts homing, waits for its end and returns the home states in order."""
    assert bench.engine.start_home([axis]) == 0
    assert bench.flag(Flag.OP_STATE, axis) == OperationState.Home
    assert not bench.flag(Flag.HOME_DONE, axis)
    states: list[int] = []

    def ended() -> bool:
        state = bench.flag(Flag.HOME_STATE, axis)
        if state and state not in states[-1:]:
            states.append(state)
        return bench.flag(Flag.OP_STATE, axis) == OperationState.Idle

    bench.until(ended, "homing")
    return states


def drive_position(bench: Machine, axis: int = POS) -> float:
    """Returns the drive's position relative to its start, in its own rad."""
    return float(bench.drives.position[axis] / bench.counts_per_rad(axis))


def homed_at(bench: Machine, where: float, axis: int = POS, tolerance: float = CYCLE_M) -> None:
    assert bench.flag(Flag.HOME_DONE, axis)
    assert bench.flag(Flag.HOME_ERROR, axis) == HomeError.NoError
    assert bench.flag(Flag.HOME_STATE, axis) == HomeState.Idle
    assert bench.flag(Flag.MOTION_COMPLETE, axis)
    assert bench.reals[Real.POS_CMD, axis] == pytest.approx(0.0, abs=1e-9)
    assert drive_position(bench, axis) == pytest.approx(where, abs=tolerance)


def failed(bench: Machine, error: HomeError, axis: int = POS) -> None:
    assert not bench.flag(Flag.HOME_DONE, axis)
    assert bench.flag(Flag.HOME_ERROR, axis) == error
    assert bench.flag(Flag.HOME_STATE, axis) == HomeState.Idle
    assert bench.flag(Flag.OP_STATE, axis) == OperationState.Idle
    assert not bench.flag(Flag.MOTION_COMPLETE, axis)


class TestTypes:
    """The rising edge of the home switch, its direction and its speed."""

    def test_where_home_is(self, bench: Machine) -> None:
        bench.switches(POS, home_from=0.5, home_to=0.6, positive_limit=1.0, negative_limit=-1.0)
        bench.homing(POS, homeType=Type.HS)
        assert home(bench) == [HomeState.HSSearch, HomeState.HomeShift]
        homed_at(bench, 0.5)

    def test_in_the_negative_direction(self, bench: Machine) -> None:
        bench.switches(POS, home_from=-0.6, home_to=-0.5)
        bench.homing(POS, homeType=Type.HS, homeDirection=Config_HomeDirection.Negative)
        home(bench)
        homed_at(bench, -0.5)

    def test_of_a_mirrored_axis(self, bench: Machine) -> None:
        """The axis's positive direction is the drive's negative one."""
        bench.switches(POS_MIRRORED, home_from=-0.6, home_to=-0.5)
        bench.homing(POS_MIRRORED, homeType=Type.HS)
        home(bench, POS_MIRRORED)
        homed_at(bench, -0.5, POS_MIRRORED)

    def test_an_inverted_home_switch(self, bench: Machine) -> None:
        bench.switches(POS, home_from=-5.0, home_to=0.5)
        bench.homing(POS, homeType=Type.HS, invertHSPolarity=True)
        home(bench)
        homed_at(bench, 0.5)

    @pytest.mark.parametrize("direction", list(Config_HomeDirection))
    def test_home_is_shifted_in_the_homing_direction(self, bench: Machine, direction: Config_HomeDirection) -> None:
        sign = 1.0 if direction is Config_HomeDirection.Positive else -1.0
        bench.switches(POS, home_from=min(0.5 * sign, 0.6 * sign), home_to=max(0.5 * sign, 0.6 * sign))
        bench.homing(POS, homeType=Type.HS, homeDirection=direction, homeShiftDistance=0.25)
        home(bench)
        homed_at(bench, 0.75 * sign)

    def test_home_may_have_another_name_than_zero(self, bench: Machine) -> None:
        bench.switches(POS, home_from=0.5, home_to=0.6)
        bench.homing(POS, homeType=Type.HS, homePosition=7.0)
        home(bench)
        assert bench.reals[Real.POS_CMD, POS] == pytest.approx(7.0, abs=1e-9)
        assert bench.position(POS) == pytest.approx(7.0, abs=1e-3)
        assert drive_position(bench) == pytest.approx(0.5, abs=CYCLE_M)

    def test_speeds(self, bench: Machine) -> None:
        bench.switches(POS, home_from=0.5, home_to=0.6)
        bench.homing(POS, homeType=Type.HS)
        assert bench.engine.start_home([POS]) == 0
        fastest: dict[int, float] = {}
        while bench.flag(Flag.OP_STATE, POS) == OperationState.Home:
            state = bench.flag(Flag.HOME_STATE, POS)
            fastest[state] = max(fastest.get(state, 0.0), abs(bench.velocity(POS)))
            assert abs(bench.reals[Real.CMD_ACC, POS]) <= ACC * (1.0 + 1e-9)
            bench.run(1)
        assert fastest[HomeState.HSSearch] == pytest.approx(FAST)
        assert fastest[HomeState.HomeShift] <= 0.5

    def test_two_axes_at_once(self, bench: Machine) -> None:
        for axis, sign in ((POS, 1.0), (POS_MIRRORED, -1.0)):
            bench.switches(axis, home_from=min(0.5 * sign, 0.6 * sign), home_to=max(0.5 * sign, 0.6 * sign))
            bench.homing(axis, homeType=Type.HS)
        assert bench.engine.start_home([POS, POS_MIRRORED]) == 0
        bench.until(bench.engine_at_rest, "both at rest")
        homed_at(bench, 0.5, POS)
        homed_at(bench, -0.5, POS_MIRRORED)

    def test_current_position_moves_nothing(self, bench: Machine) -> None:
        bench.homing(POS, homeType=Type.CurrentPos, homePosition=3.0)
        assert bench.engine.start_home([POS]) == 0
        assert bench.flag(Flag.HOME_DONE, POS)
        assert bench.flag(Flag.OP_STATE, POS) == OperationState.Idle
        assert bench.reals[Real.POS_CMD, POS] == 3.0


class TestSensorOnAtStart:
    def test_home_switch(self, bench: Machine) -> None:
        bench.switches(POS, home_from=-0.1, home_to=0.1)
        bench.homing(POS, homeType=Type.HS)
        assert home(bench)[0] == HomeState.HSClearReverse
        homed_at(bench, -0.1)

    def test_home_switch_that_does_not_end(self, bench: Machine) -> None:
        bench.switches(POS, home_from=-5.0, home_to=0.1)
        bench.homing(POS, homeType=Type.HS, maxHSOnAtStartReverseDistance=0.5)
        home(bench)
        failed(bench, HomeError.MaxHSOnAtStartRevDistanceTraveled)
        assert drive_position(bench) == pytest.approx(-0.5 - FAST * FAST / (2.0 * ACC), abs=2 * CYCLE_M)


class TestLimitOnTheWay:
    @pytest.mark.parametrize("action", [Config_LimitSwitchType.PyNone, Config_LimitSwitchType.ServoOff])
    def test_turns_round_to_a_home_switch_behind(self, bench: Machine, action: Config_LimitSwitchType) -> None:
        """The limit switch does not have its usual effect."""
        bench.switches(POS, home_from=-0.6, home_to=-0.5, positive_limit=0.3, negative_limit=-2.0)
        bench.limits(POS, lsType=action)
        bench.homing(POS, homeType=Type.HS, homingReverseDistance=0.05, maxLSReverseDistance=2.0)
        states = home(bench)
        turned = HomeState.HSFallingEdgeSearchReverse
        assert states == [HomeState.HSSearch, turned, HomeState.HSSearch, HomeState.HomeShift]
        homed_at(bench, -0.6)

    def test_the_reverse_distance_comes_after_the_home_switch(self, bench: Machine) -> None:
        bench.switches(POS, home_from=-0.6, home_to=-0.5, positive_limit=0.3)
        bench.homing(POS, homeType=Type.HS, homingReverseDistance=0.2)
        assert bench.engine.start_home([POS]) == 0
        lowest = 0.0
        while bench.flag(Flag.OP_STATE, POS) == OperationState.Home:
            bench.run(1)
            lowest = min(lowest, drive_position(bench))
        overshoot = FAST * FAST / (2.0 * ACC)
        assert lowest == pytest.approx(-0.6 - overshoot - 0.2, abs=2 * CYCLE_M)

    def test_no_home_switch_within_reach_behind(self, bench: Machine) -> None:
        bench.switches(POS, home_from=-5.0, home_to=-4.9, positive_limit=0.3)
        bench.homing(POS, homeType=Type.HS, maxLSReverseDistance=1.0)
        home(bench)
        failed(bench, HomeError.MaxLSRevDistanceTraveled)

    def test_no_home_switch_between_the_limits(self, bench: Machine) -> None:
        bench.switches(POS, home_from=5.0, home_to=5.1, positive_limit=0.3, negative_limit=-0.3)
        bench.homing(POS, homeType=Type.HS)
        home(bench)
        failed(bench, HomeError.LSTriggered)
        assert bench.flag(Flag.END_REASON, POS) == ErrorCode.AxisHardLimit
        assert drive_position(bench) == pytest.approx(-0.35, abs=2 * CYCLE_M)

    def test_a_limit_within_the_reverse_distance(self, bench: Machine) -> None:
        bench.switches(POS, home_from=-0.6, home_to=-0.5, positive_limit=0.3, negative_limit=-0.8)
        bench.homing(POS, homeType=Type.HS, homingReverseDistance=1.0)
        home(bench)
        failed(bench, HomeError.LSTriggered)
        assert drive_position(bench) > -0.9, "it did not go on into the end"

    def test_while_shifting(self, bench: Machine) -> None:
        bench.switches(POS, home_from=0.1, home_to=0.2, positive_limit=0.5)
        bench.homing(POS, homeType=Type.HS, homeShiftDistance=1.0)
        home(bench)
        failed(bench, HomeError.LSTriggered)

    def test_while_shifting_back(self, bench: Machine) -> None:
        bench.switches(POS, home_from=0.1, home_to=0.2, negative_limit=-0.5)
        bench.homing(POS, homeType=Type.HS, homeShiftDistance=-1.0)
        home(bench)
        failed(bench, HomeError.LSTriggered)
        assert drive_position(bench) > -0.6

    def test_turns_round_once(self, bench: Machine) -> None:
        bench.switches(POS, home_from=-0.6, home_to=-0.5, positive_limit=0.3)
        bench.homing(POS, homeType=Type.HS)
        assert bench.engine.start_home([POS]) == 0
        turned = HomeState.HSFallingEdgeSearchReverse
        bench.until(lambda: bench.flag(Flag.HOME_STATE, POS) == turned, "the way back")
        bench.until(lambda: bench.flag(Flag.HOME_STATE, POS) == HomeState.HSSearch, "the second search")
        sensors = bench.drives.switches[POS]
        assert sensors is not None
        sensors.home_from = sensors.home_to = 1e12  # the switch breaks
        bench.rest(POS)
        failed(bench, HomeError.LSTriggered)
        assert drive_position(bench) > 0.3

    def test_afterwards_the_limit_acts_again(self, bench: Machine) -> None:
        bench.switches(POS, home_from=0.1, home_to=0.2, positive_limit=0.5)
        bench.limits(POS, lsType=Config_LimitSwitchType.Dec)
        bench.homing(POS, homeType=Type.HS)
        home(bench)
        assert bench.along(POS, 1.0) == 0
        bench.rest(POS)
        assert bench.flag(Flag.END_REASON, POS) == ErrorCode.AxisHardLimit


def on_its_way(bench: Machine) -> None:
    bench.switches(POS, home_from=5.0, home_to=5.1)
    bench.homing(POS, homeType=Type.HS)
    assert bench.engine.start_home([POS]) == 0
    bench.run(300)
    assert bench.velocity(POS) == pytest.approx(FAST)


class TestInterrupted:
    def test_cancel_stops_at_the_slow_deceleration(self, bench: Machine) -> None:
        on_its_way(bench)
        start = bench.position(POS)
        assert bench.engine.cancel_home(POS) == 0
        assert bench.flag(Flag.HOME_STATE, POS) == HomeState.Cancel
        bench.rest(POS)
        assert bench.position(POS) - start == pytest.approx(FAST * FAST / (2.0 * ACC), abs=CYCLE_M)
        failed(bench, HomeError.NoError)

    def test_cancel_of_nothing(self, bench: Machine) -> None:
        assert bench.engine.cancel_home(POS) == 0
        assert bench.engine.cancel_home(99) == ErrorCode.AxisOutOfRange
        assert bench.flag(Flag.HOME_STATE, POS) == HomeState.Idle

    @pytest.mark.parametrize("at_ms", [1, 50, 300])
    @pytest.mark.parametrize("how", ["stop", "quick", "one cycle", "estop", "servo off", "alarm", "bus", "orphan"])
    def test_by_anything_else(self, bench: Machine, how: str, at_ms: int) -> None:
        engine = bench.engine
        bench.switches(POS, home_from=5.0, home_to=5.1)
        bench.homing(POS, homeType=Type.HS)
        assert engine.start_home([POS], 42) == 0
        bench.run(at_ms)
        match how:
            case "stop":
                assert engine.motion.stop([POS], AxisCommandMode.Position) == 0
            case "quick":
                assert engine.motion.quick_stop([POS], AxisCommandMode.Position) == 0
            case "one cycle":
                bench.soft_stop(POS, 1e6)
            case "estop":
                assert engine.exec_estop(EStopLevel.Level1) == 0
            case "servo off":
                assert engine.set_servo_on([POS], 0) == 0
            case "alarm":
                bench.drives.alarms[POS] = 77
            case "bus":
                assert engine.stop_communication() == 0
            case _:
                engine.motion.quick_stop_axis(POS)
        bench.run(500)
        failed(bench, HomeError.NoError)
        assert bench.velocity(POS) == 0.0

    @pytest.mark.parametrize("shift", [False, True])
    def test_a_stop_while_it_brakes_or_shifts(self, bench: Machine, shift: bool) -> None:
        bench.switches(POS, home_from=0.3, home_to=0.6)
        bench.homing(POS, homeType=Type.HS)
        assert bench.engine.start_home([POS]) == 0
        bench.until(lambda: bench.flag(Flag.HOME_SWITCH, POS), "home switch")
        if shift:
            bench.until(lambda: bench.flag(Flag.HOME_STATE, POS) == HomeState.HomeShift, "shifting")
        bench.run(10)
        bench.soft_stop(POS, 1e6)
        bench.run(200)
        failed(bench, HomeError.NoError)

    def test_no_other_motion_starts_meanwhile(self, bench: Machine) -> None:
        on_its_way(bench)
        assert bench.move(POS, 1.0) == CoreMotionErrorCode.NotIdleOrPosState
        assert bench.along(POS, 1.0) == CoreMotionErrorCode.NotIdleOrPosState
        assert bench.engine.start_home([POS]) == ErrorCode.NotIdleState
        assert bench.engine.set_gear(POS, 2.0, 1.0) == ErrorCode.NotIdleState
        assert bench.flag(Flag.OP_STATE, POS) == OperationState.Home

    def test_and_then_again(self, bench: Machine) -> None:
        on_its_way(bench)
        assert bench.engine.cancel_home(POS) == 0
        bench.rest(POS)
        bench.switches(POS, home_from=0.5, home_to=0.6)
        before = drive_position(bench)
        home(bench)
        homed_at(bench, before + 0.5)


class TestRefused:
    @pytest.mark.parametrize(
        ("kind", "code"),
        [
            (Type.ZPulse, CoreMotionErrorCode.ZPulseDetectionUnsupported),
            (Type.HS, CoreMotionErrorCode.HomeSwitchDetectionUnsupported),
            (Type.HSZPulse, CoreMotionErrorCode.HomeSwitchDetectionUnsupported),
            (Type.LS, CoreMotionErrorCode.LimitSwitchDetectionUnsupported),
            (Type.LSReverseZPulse, CoreMotionErrorCode.LimitSwitchDetectionUnsupported),
            (Type.NearLS, CoreMotionErrorCode.LimitSwitchDetectionUnsupported),
            (Type.ExternalLS, CoreMotionErrorCode.LimitSwitchDetectionUnsupported),
            (Type.TouchProbe, CoreMotionErrorCode.TouchProbeDetectionUnsupported),
            (Type.HSTouchProbe, CoreMotionErrorCode.TouchProbeDetectionUnsupported),
            (Type.MechanicalEndDetection, CoreMotionErrorCode.LimitSwitchDetectionUnsupported),
            (Type.MechanicalEndDetectionHS, CoreMotionErrorCode.LimitSwitchDetectionUnsupported),
        ],
    )
    def test_without_the_sensor(self, bench: Machine, kind: Type, code: int) -> None:
        bench.flags[Flag.HOME_DONE, POS] = 1
        bench.homing(POS, homeType=kind)
        assert bench.engine.start_home([POS]) == code
        assert bench.flag(Flag.HOME_DONE, POS), "nothing has begun"

    @pytest.mark.parametrize(
        ("kind", "code"),
        [
            (Type.HSZPulse, CoreMotionErrorCode.ZPulseDetectionUnsupported),
            (Type.HSHS, ErrorCode.NoSupportedFunction),
            (Type.HSOff, ErrorCode.NoSupportedFunction),
        ],
    )
    def test_types_that_this_engine_does_not_have(self, bench: Machine, kind: Type, code: int) -> None:
        bench.switches(POS, home_from=0.5, home_to=0.6, positive_limit=1.0)
        bench.homing(POS, homeType=kind)
        assert bench.engine.start_home([POS]) == code

    def test_states(self, bench: Machine) -> None:
        bench.switches(POS, home_from=0.5, home_to=0.6)
        bench.switches(VEL, home_from=0.5, home_to=0.6)
        for axis in (POS, VEL):
            bench.homing(axis, homeType=Type.HS)
        engine = bench.engine
        assert engine.start_home([VEL]) == CoreMotionErrorCode.NotPosMode
        assert engine.start_home([POS, VEL]) == CoreMotionErrorCode.NotPosMode
        assert bench.flag(Flag.OP_STATE, POS) == OperationState.Idle, "all or none"
        engine.set_servo_on([POS], 0)
        bench.run(10)
        assert engine.start_home([POS]) == CoreMotionErrorCode.NotServoOn
        bench.drives.alarms[POS] = 5
        bench.run(5)
        assert engine.start_home([POS]) == ErrorCode.AxisAmpAlarm
        assert engine.exec_estop(EStopLevel.Level1) == 0
        assert engine.start_home([POS]) == CoreMotionErrorCode.EmergencyStopSignalOn
        assert engine.stop_communication() == 0
        assert engine.start_home([POS]) == ErrorCode.CommNotStarted

"""Motion messages: which are rejected, with which texts, and the resulting commands."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.wmx.api import AxisCommandMode, EngineState, OperationState, Profile, ProfileType
from robot_stack.wmx.axes import Flag, Real, StatusSnapshot
from robot_stack.wmx.general.commands import (
    AxisOrder,
    CommandLimits,
    check_order,
    check_ready,
    from_present,
    position_commands,
    timed_velocity_commands,
    unknown_profile,
    velocity_commands,
)
from robot_stack.wmx.general.requests import Refused
from tests.unit.wmx_general.snapshots import standing, with_flag

NAN, INF = math.nan, math.inf
UNLIMITED = CommandLimits()
POSITION, VELOCITY = AxisCommandMode.Position, AxisCommandMode.Velocity


def refusal(order: AxisOrder) -> str:
    with pytest.raises(Refused) as caught:
        check_order(order, UNLIMITED)
    return str(caught.value)


@pytest.mark.parametrize(
    ("order", "text"),
    [
        (AxisOrder([], [], [], []), "index is empty: it must name at least one axis"),
        (AxisOrder([0] * 129, [], [], []), "index has 129 entries: there are at most 128 axes"),
        (AxisOrder([0, 1], [1.0], [1.0, 1.0], [1.0, 1.0]), "velocity has 1 entry, index has 2 entries"),
        (AxisOrder([0], [1.0], [], [1.0]), "acc has 0 entries, index has 1 entry: they must be equally long"),
        (AxisOrder([0], [1.0], [1.0], [1.0, 2.0]), "dec has 2 entries, index has 1 entry"),
        (AxisOrder([0], [1.0], [1.0], [1.0], []), "target has 0 entries, index has 1 entry"),
        (AxisOrder([0, 2, 0], [1.0] * 3, [1.0] * 3, [1.0] * 3), "index names axis 0 twice: index[0] and index[2]"),
        (AxisOrder([-1], [1.0], [1.0], [1.0]), "index[0] is -1: the engine has axes 0 to 127"),
        (AxisOrder([0, 128], [1.0] * 2, [1.0] * 2, [1.0] * 2), "index[1] is 128: the engine has axes 0 to 127"),
        (AxisOrder([0], [NAN], [1.0], [1.0]), "velocity[0] is nan: it must be finite"),
        (AxisOrder([0], [1.0], [INF], [1.0]), "acc[0] is inf: it must be finite"),
        (AxisOrder([0], [1.0], [1.0], [-INF]), "dec[0] is -inf: it must be finite"),
        (AxisOrder([0, 1], [1.0] * 2, [1.0] * 2, [1.0] * 2, [0.0, NAN]), "target[1] is nan: it must be finite"),
        (AxisOrder([0], [1.0], [0.0], [1.0]), "acc[0] is 0: it must be above 0"),
        (AxisOrder([0], [1.0], [1.0], [-2.5]), "dec[0] is -2.5: it must be above 0"),
        (AxisOrder([0], [-1.0], [1.0], [1.0], [1.0]), "velocity[0] is -1: it must be above 0"),
        (AxisOrder([0], [0.0], [1.0], [1.0], [1.0]), "velocity[0] is 0: it must be above 0"),
    ],
)
def test_a_bad_message_is_refused_by_field_and_reason(order: AxisOrder, text: str) -> None:
    assert text in refusal(order)


@pytest.mark.parametrize(
    ("velocity", "acc", "dec", "text"),
    [
        (5.01, 1.0, 1.0, r"velocity\[0\] is 5.01: at most 5 is allowed"),
        (-5.01, 1.0, 1.0, r"velocity\[0\] is -5.01: at most 5 is allowed"),
        (1.0, 20.1, 1.0, r"acc\[0\] is 20.1: at most 20 is allowed"),
        (1.0, 1.0, 21.0, r"dec\[0\] is 21: at most 20 is allowed"),
    ],
)
def test_limits(velocity: float, acc: float, dec: float, text: str) -> None:
    with pytest.raises(Refused, match=text):
        check_order(AxisOrder([0], [velocity], [acc], [dec]), CommandLimits(5.0, 20.0))
    check_order(AxisOrder([0], [velocity], [acc], [dec]), UNLIMITED)
    check_order(AxisOrder([0, 1], [-5.0, 0.0], [20.0] * 2, [20.0] * 2), CommandLimits(5.0, 20.0))


@pytest.mark.parametrize(
    ("flag", "value", "mode", "text"),
    [
        (Flag.AMP_ALARM, 1, POSITION, "axis 1 has amplifier alarm 0"),
        (Flag.FOLLOWING_ERROR_ALARM, 1, POSITION, "axis 1 has a following error alarm"),
        (Flag.SERVO_OFFLINE, 1, POSITION, "axis 1 is offline"),
        (Flag.SERVO_ON, 0, POSITION, "axis 1 has its servo off"),
        (Flag.COMMAND_MODE, VELOCITY, POSITION, "axis 1 is not in position mode"),
        (Flag.OP_STATE, OperationState.Stop, POSITION, "axis 1 is busy: Stop"),
        (Flag.OP_STATE, OperationState.Intpl, POSITION, "axis 1 is busy: Intpl"),
        (Flag.OP_STATE, 77, POSITION, "axis 1 is busy: operation state 77"),
    ],
)
def test_one_axis_that_cannot_obey_refuses_all(flag: Flag, value: int, mode: AxisCommandMode, text: str) -> None:
    with pytest.raises(Refused, match=text):
        check_ready([0, 1], mode, with_flag(flag, 1, value))
    check_ready([0, 2], mode, with_flag(flag, 1, value))  # the same fault on an axis that is not part of the command


@pytest.mark.parametrize(
    ("axes", "mode", "snapshot", "text"),
    [
        ([0], VELOCITY, standing(), "axis 0 is not in velocity mode"),
        ([0, 4], POSITION, standing(4), r"index\[1\] is 4: the engine has axes 0 to 3"),
        ([0], POSITION, standing(engine_state=EngineState.Running), "does not communicate with the drives: it is Runn"),
        ([0], POSITION, standing(emergency_stop=True), "the engine's emergency stop is active"),
    ],
)
def test_an_engine_that_is_not_ready_refuses(
    axes: list[int], mode: AxisCommandMode, snapshot: StatusSnapshot, text: str
) -> None:
    with pytest.raises(Refused, match=text):
        check_ready(axes, mode, snapshot)
    for state in (OperationState.Idle, OperationState.Pos, OperationState.Jog):
        check_ready([1], POSITION, with_flag(Flag.OP_STATE, 1, state))


def test_commands_carry_every_field_to_its_axis() -> None:
    order = AxisOrder([3, 1], [4.0, 5.0], [6.0, 7.0], [8.0, 9.0], [0.5, -0.5])
    first, second = position_commands(order)
    assert (first.axis, first.target, first.profile) == (3, 0.5, Profile.SetupTrapezoidal(4.0, 6.0, 8.0))
    assert (second.axis, second.target, second.profile) == (1, -0.5, Profile.SetupTrapezoidal(5.0, 7.0, 9.0))
    plain = velocity_commands(order)
    assert [(c.axis, c.profile.velocity, c.profile.acc, c.profile.dec) for c in plain] == [
        (3, 4.0, 6.0, 8.0),
        (1, 5.0, 7.0, 9.0),
    ]
    assert {c.profile.type for c in plain} == {ProfileType.Trapezoidal}


@pytest.mark.parametrize(
    ("now", "velocity", "reached", "run_ms", "acc_ms"),
    [
        (0.0, 1.0, 1.0, 150.0, 100.0),  # 1 rad/s at 10 rad/s2, and the rest of 0.25 s at this speed
        (0.5, 1.0, 1.0, 200.0, 50.0),
        (0.0, -9.0, -2.5, 1.0, 250.0),  # as far as possible in the time
        (2.0, 1.0, 1.0, 200.0, 1.0),  # deceleration at 20 rad/s2
        (1.0, -1.0, -1.0, 100.0, 100.0),  # through zero: 50 ms down, 100 ms up
    ],
)
def test_timed_velocities_take_profiles_by_times_and_end_in_time(
    now: float, velocity: float, reached: float, run_ms: float, acc_ms: float
) -> None:
    snapshot = standing(4)
    snapshot.reals[Real.VELOCITY_CMD, 1] = now
    order = AxisOrder([1, 2], [velocity, 0.0], [10.0, 10.0], [20.0, 20.0])
    turning, resting = timed_velocity_commands(order, snapshot, 0.25)
    assert [(command.axis, command.profile.velocity) for command in resting] == [(2, 0.0)]
    (command,) = turning
    assert command.axis == 1
    assert command.profile.type == ProfileType.TimeAccTrapezoidal
    assert command.profile.velocity == pytest.approx(reached, rel=1e-4)
    assert command.runTimeMilliseconds == pytest.approx(run_ms, rel=1e-4)
    assert command.profile.accTimeMilliseconds == pytest.approx(acc_ms, rel=1e-4)
    assert command.profile.decTimeMilliseconds == pytest.approx(1e3 * abs(reached) / 20.0, rel=1e-4)


def test_relative_to_the_present_position_while_an_axis_moves() -> None:
    snapshot = with_flag(Flag.OP_STATE, 1, OperationState.Pos)
    snapshot.reals[Real.POS_CMD] = [10.0, 20.0, 30.0, 40.0]
    snapshot.reals[Real.PROFILE_TARGET_POS] = 99.0
    absolute = from_present(AxisOrder([0, 1], [1.0, 1.0], [1.0, 1.0], [1.0, 1.0], [0.5, -0.5]), snapshot)
    assert absolute is not None
    assert absolute.target == [10.5, 19.5]
    assert from_present(AxisOrder([0, 2], [1.0] * 2, [1.0] * 2, [1.0] * 2, [0.5] * 2), snapshot) is None


@pytest.mark.parametrize(
    ("profile", "odd"), [("", False), ("Trapezoidal", False), (" trapezoidal ", False), ("sine", True)]
)
def test_profile(profile: str, odd: bool) -> None:
    assert unknown_profile(profile) is odd


NUMBERS = st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=4)


@settings(deadline=None)
@given(st.lists(st.integers(-3, 140), max_size=4), NUMBERS, NUMBERS, NUMBERS, st.none() | NUMBERS)
def test_whatever_passes_is_whole(
    index: list[int], velocity: list[float], acc: list[float], dec: list[float], target: list[float] | None
) -> None:
    order = AxisOrder(index, velocity, acc, dec, target)
    try:
        check_order(order, UNLIMITED)
    except Refused:
        return
    assert len(index) == len(velocity) == len(acc) == len(dec) == len(set(index)) > 0
    assert all(0 <= axis < 128 for axis in index)
    assert all(math.isfinite(value) for value in (*velocity, *(target or ())))
    assert all(0.0 < value < INF for value in (*acc, *dec))
    assert target is None or (len(target) == len(index) and all(value > 0.0 for value in velocity))

"""The spline for points with velocities, for a late start, and for a slower motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from robot_stack.wmx.trajectory.plan import PlanLimits, plan_spline
from robot_stack.wmx.trajectory.results import GoalCode, GoalRefused
from robot_stack.wmx.trajectory.spline import ClampedSpline
from robot_stack.wmx.trajectory.waypoints import STANDS_RADPS, Waypoints, curve_of
from tests.unit.wmx.trajectory.fake_arm import JOINTS, NO_LIMITS

HERE = np.array([0.5, -0.5])
NEAR_RAD = NO_LIMITS.near.max_deviation_rad


def through(*states: tuple[float, float, float, float], accelerations: bool = False) -> Waypoints:
    """Returns waypoints from (time, position, velocity, acceleration), both joints equal except for their start."""
    t, p, v, a = np.array(states).T
    both = [np.column_stack([column, column]) for column in (p, v, a)]
    return Waypoints(t, both[0] + HERE, both[1], both[2] if accelerations else None)


def plan(points: Waypoints, late_s: float = 0.0, limits: PlanLimits = NO_LIMITS) -> ClampedSpline:
    spline = plan_spline(points, late_s, HERE, JOINTS, limits)
    assert spline is not None
    return spline


def refusal(points: Waypoints, late_s: float = 0.0, limits: PlanLimits = NO_LIMITS) -> str:
    with pytest.raises(GoalRefused) as caught:
        plan(points, late_s, limits)
    assert caught.value.fault.code == GoalCode.INVALID_GOAL
    return caught.value.fault.text


def test_accelerations_are_driven_through() -> None:
    points = through((0.0, 0.0, 0.0, 0.0), (1.0, 1.0, 0.4, 2.0), (2.0, 2.0, 0.0, 0.0), accelerations=True)
    position, velocity, acceleration = plan(points).evaluate(1.0)
    assert position == pytest.approx(HERE + 1.0, abs=1e-9)
    assert velocity == pytest.approx([0.4, 0.4], abs=0.02)
    assert acceleration == pytest.approx([2.0, 2.0], abs=0.3)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(0.05, 1.5), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0)),
        min_size=1,
        max_size=6,
    ),
    st.booleans(),
)
@example([(0.0625, 0.5625, 0.0, 0.0), (1.0, 0.5, 0.0, 0.0)], False)  # 864 rad/s^2 to a slow start: 0.203 mrad off
@example([(0.5, 0.0, 6.1e-5, 0.0), (0.125, 1.0, 0.0, 0.0)], False)  # drifts less than the engine's least distance
def test_the_engine_follows_the_curve_of_the_goal(
    steps: list[tuple[float, float, float, float]], accelerations: bool
) -> None:
    states = np.array(steps)
    states[:, 0] = np.cumsum(states[:, 0])
    states[-1, 2] = 0.0
    points = through(*map(tuple, states), accelerations=accelerations)
    spline = plan_spline(points, 0.0, HERE, JOINTS, NO_LIMITS)
    if spline is None:
        assert np.abs(points.positions[-1] - HERE).max() <= 1e-3
        return
    near = np.abs(points.positions[0] - HERE).max() <= 1e-3 and abs(states[0, 2]) <= STANDS_RADPS
    if near:
        return  # its time is zero then, as documented
    curve = curve_of(points.after_rest(HERE))
    at = np.linspace(0.0, spline.times_s[-1], 997)
    # Where points 4 ms apart would be equal, they are up to 8 ms apart, and after a jump of the acceleration the spline
    # is off by 1/64 of it times that squared. The velocity changes by the acceleration within one or two cycles.
    greatest = np.abs(curve(at, 2)).max()
    assert np.abs(spline.positions_at(at) - curve(at)).max() <= 2.0 * NEAR_RAD + 8e-3**2 / 64.0 * greatest
    fastest_radps = NO_LIMITS.near.max_deviation_radps + 2e-3 * greatest
    assert np.abs(spline.velocities_at(at) - curve(at, 1)).max() <= fastest_radps
    assert np.diff(spline.times_s).min() > 1e-6
    assert np.abs(np.diff(spline.positions, axis=0)).max(axis=1).min() > 1e-6


def test_a_pause_between_velocities_stays_one() -> None:
    points = through((1.0, 1.0, 0.0, 0.0), (3.0, 1.0, 0.0, 0.0), (4.0, 2.0, 0.0, 0.0))
    spline = plan(points)
    assert spline.times_s[-1] == 4.0
    for time_s in np.linspace(1.0, 3.0, 9):
        assert spline.evaluate(time_s)[0] == pytest.approx(HERE + 1.0, abs=1e-4)


def test_long_ways_take_no_more_points_than_they_need() -> None:
    spline = plan(through((3600.0, 1.0, 0.001, 0.0), (7200.0, -1.0, 0.0, 0.0)))
    assert len(spline.times_s) < 100
    assert spline.evaluate(3600.0)[1] == pytest.approx([0.001, 0.001], abs=1e-4)


def test_trajectory_ending_at_present_position_with_velocities_needs_no_spline() -> None:
    stay = through((0.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    assert plan_spline(stay, 0.0, HERE, JOINTS, NO_LIMITS) is None


def test_trajectory_needing_too_many_spline_points_is_rejected() -> None:
    wild = through((0.5, 1.0, 80.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    few = NO_LIMITS.near.model_copy(update={"max_deviation_rad": 1e-5, "max_deviation_radps": 0.01, "max_points": 40})
    text = refusal(wild, limits=replace(NO_LIMITS, near=few))
    assert text.startswith("points.velocities: the engine's spline would need more than 40 points")


def test_nothing_can_have_a_velocity_at_time_zero() -> None:
    moving = through((0.0, 0.0, 0.3, 0.0), (1.0, 1.0, 0.0, 0.0))
    assert refusal(moving) == "points[0].velocities: shoulder at 0.3 rad/s at time 0, at standstill"


def test_a_first_point_here_that_has_a_velocity_keeps_its_time() -> None:
    spline = plan(through((0.5, 0.0, 0.3, 0.0), (1.0, 1.0, 0.0, 0.0)))
    assert spline.times_s[-1] == 1.0
    assert spline.evaluate(0.5)[1] == pytest.approx([0.3, 0.3], abs=0.02)


def test_a_last_point_that_is_left_out_leaves_rest() -> None:
    spline = plan(through((1.0, 1.0, 0.2, 0.0), (1.0005, 1.0, 0.0, 0.0)))
    assert (spline.times_s[-1], spline.evaluate(2.0)[1].tolist()) == (1.0, [0.0, 0.0])


# --- a stamp in the past ----------------------------------------------------------------------------------------------


EAGER = replace(NO_LIMITS, catch_up_acceleration_radps2=5.0)
PLAIN = Waypoints(np.array([0.0, 1.0, 2.0, 3.0]), HERE + np.array([[0.0] * 2, [0.3] * 2, [0.6] * 2, [0.9] * 2]))


def test_points_are_reached_when_they_are_due() -> None:
    for late_s, first in ((0.02, 1.0), (0.2, 1.0), (1.2, 2.0)):
        spline, due = plan(PLAIN, late_s, EAGER), curve_of(PLAIN)
        assert spline.times_s[-1] == pytest.approx(3.0 - late_s)
        assert spline.evaluate(0.0)[0] == pytest.approx(HERE)
        for time_s in np.linspace(first, 3.0, 20):
            assert spline.evaluate(time_s - late_s)[0] == pytest.approx(due(time_s), abs=NEAR_RAD)


def test_a_point_that_cannot_be_reached_in_time_is_left_out() -> None:
    """Reaching the point at 1 s within 0.01 s would need far more acceleration than requested."""
    spline = plan(PLAIN, 0.99, EAGER)
    assert spline.times_s[-1] == pytest.approx(2.01)
    assert spline.max_acceleration().max() < 6.0
    assert spline.evaluate(1.01)[0] == pytest.approx(HERE + 0.6, abs=1e-6)


def test_a_trajectory_that_cannot_be_caught_up_with_is_refused() -> None:
    text = refusal(PLAIN, 2.99)
    assert text == "trajectory.header.stamp: 2.990 s ago, it is too late to catch up with the trajectory"
    assert "too late to catch up" in refusal(PLAIN, 2.9999)
    hasty = replace(NO_LIMITS, catch_up_acceleration_radps2=1e6)
    assert plan(PLAIN, 2.99, hasty).times_s[-1] == pytest.approx(0.01)
    stay = Waypoints(np.array([0.0, 1.0]), np.vstack([HERE, HERE]))
    assert plan_spline(stay, 0.5, HERE, JOINTS, NO_LIMITS) is None, "an arm that is there already is never late"


@settings(max_examples=60, deadline=None)
@given(st.floats(0.001, 2.9))
def test_catching_up_asks_no_more_than_is_allowed(late_s: float) -> None:
    try:
        spline = plan(PLAIN, late_s)
    except GoalRefused:
        assert late_s > 1.0
        return
    own = np.abs(curve_of(PLAIN)(np.linspace(0.0, 3.0, 300), 2)).max()
    assert spline.times_s[-1] == pytest.approx(3.0 - late_s)
    assert spline.max_acceleration().max() <= 1.3 * max(1.5 * own, NO_LIMITS.catch_up_acceleration_radps2)


# --- speed scaling, turns, the first point ----------------------------------------------------------------------------


@pytest.mark.parametrize("points", [PLAIN, through((1.0, 1.0, 0.4, 0.0), (2.0, 2.0, 0.0, 0.0))])
def test_scaled_speed_is_the_same_path_in_more_time(points: Waypoints) -> None:
    spline, slow = plan(points), plan(points, limits=replace(NO_LIMITS, speed_scaling=0.25))
    assert slow.duration_s == pytest.approx(4.0 * spline.duration_s)
    assert slow.max_speed() == pytest.approx(0.25 * spline.max_speed(), rel=0.01)
    for time_s in np.linspace(0.0, spline.duration_s, 10):
        assert slow.evaluate(4.0 * time_s)[0] == pytest.approx(spline.evaluate(time_s)[0], abs=2.0 * NEAR_RAD)


def test_a_scaled_late_start_is_late_by_the_time_that_has_passed() -> None:
    slow = plan(PLAIN, 0.5, replace(NO_LIMITS, speed_scaling=0.5))
    assert slow.times_s[-1] == pytest.approx(2.0 * (3.0 - 0.5))


def test_a_continuous_joint_goes_the_short_way() -> None:
    points = Waypoints(np.array([2.0]), np.array([[0.5 + 2.0 * np.pi - 0.2, -0.5]]))
    assert plan(points).positions[-1] == pytest.approx([0.5 + 2.0 * np.pi - 0.2, -0.5])
    turning = replace(NO_LIMITS, continuous=(0,))
    assert plan(points, limits=turning).positions[-1] == pytest.approx([0.3, -0.5])
    whole_turn = Waypoints(np.array([2.0]), np.array([[0.5 - 2.0 * np.pi, -0.5]]))
    assert plan_spline(whole_turn, 0.0, HERE, JOINTS, turning) is None, "already there"


def test_start_deviation_is_checked_only_for_first_point_at_time_zero() -> None:
    strict = replace(NO_LIMITS, max_start_deviation_rad=0.05)
    far = HERE + 0.2
    assert plan(Waypoints(np.array([2.0]), np.array([far])), limits=strict).duration_s == 2.0
    text = refusal(Waypoints(np.array([0.0, 1.0]), np.vstack([far, far])), limits=strict)
    assert "points[0]: " in text
    assert " is 0.2000 rad away from the present position at time 0, at most 0.05 rad" in text

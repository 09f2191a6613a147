"""Time rules: the spline for a goal, and points that are not sent to the engine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.wmx.trajectory.plan import plan_spline
from robot_stack.wmx.trajectory.results import GoalCode, GoalRefused
from robot_stack.wmx.trajectory.spline import ClampedSpline
from robot_stack.wmx.trajectory.waypoints import Waypoints
from tests.unit.wmx.trajectory.fake_arm import JOINTS, NO_LIMITS

HERE = np.array([0.5, -0.5])
# The documented limits of the engine.
ENGINE_GAP_S, ENGINE_SAME_RAD = 1e-6, 1e-6


def plan(*waypoints: tuple[float, tuple[float, float]], limits=NO_LIMITS) -> ClampedSpline | None:
    positions = np.array([position for _, position in waypoints])
    points = Waypoints(np.array([time_s for time_s, _ in waypoints]), positions)
    return plan_spline(points, 0.0, HERE, JOINTS, limits)


def rows(spline: ClampedSpline | None) -> list[tuple[float, list[float]]]:
    assert spline is not None
    return list(zip(spline.times_s.tolist(), spline.positions.tolist(), strict=True))


def test_first_point_at_time_zero_gives_its_place_to_the_present_position() -> None:
    assert rows(plan((0.0, (0.5, -0.5)), (1.0, (1.0, 0.0)))) == [(0.0, [0.5, -0.5]), (1.0, [1.0, 0.0])]
    assert rows(plan((2.0, (1.0, 0.0)))) == [(0.0, [0.5, -0.5]), (2.0, [1.0, 0.0])]
    assert rows(plan((0.0, (0.7, -0.5)), (1.0, (1.0, 0.0)))) == [(0.0, [0.5, -0.5]), (1.0, [1.0, 0.0])]


def test_first_time_is_forced_to_zero_only_at_the_present_position() -> None:
    assert rows(plan((0.3, (0.5005, -0.5)), (1.0, (1.0, 0.0)))) == [(0.0, [0.5, -0.5]), (1.0, [1.0, 0.0])]
    assert rows(plan((0.3, (0.6, -0.5)), (1.0, (1.0, 0.0)))) == [
        (0.0, [0.5, -0.5]),
        (0.3, [0.6, -0.5]),
        (1.0, [1.0, 0.0]),
    ]


def test_last_point_within_a_millisecond_is_ignored() -> None:
    assert rows(plan((1.0, (1.0, 0.0)), (1.0009, (1.1, 0.0)))) == [(0.0, [0.5, -0.5]), (1.0, [1.0, 0.0])]
    assert len(rows(plan((1.0, (1.0, 0.0)), (1.0011, (1.1, 0.0))))) == 3


def test_points_the_engine_would_refuse_are_merged() -> None:
    spline = plan((0.5, (0.7, 0.0)), (0.5000005, (0.8, 0.0)), (1.0, (1.0, 0.0)))
    assert rows(spline) == [(0.0, [0.5, -0.5]), (0.5, [0.7, 0.0]), (1.0, [1.0, 0.0])]
    spline = plan((0.5, (0.7, 0.0)), (0.55, (0.7, 0.0)), (1.0, (1.0, 0.0)))
    assert rows(spline) == [(0.0, [0.5, -0.5]), (0.5, [0.7, 0.0]), (1.0, [1.0, 0.0])]


def test_a_pause_on_the_way_stays_one() -> None:
    """The engine would drop the repeated point and with it three seconds."""
    spline = plan((1.0, (1.0, 0.0)), (2.5, (1.0, 0.0)), (4.0, (1.0, 0.0)), (5.0, (2.0, 0.0)))
    assert spline is not None
    assert spline.times_s.tolist() == [0.0, 1.0, 2.5, 4.0, 5.0]
    assert np.abs(spline.positions[1:4] - [1.0, 0.0]).max() <= 2.1e-6
    assert np.abs(np.diff(spline.positions, axis=0)).max(axis=1).min() > ENGINE_SAME_RAD


def test_pause_at_end_of_trajectory_is_removed() -> None:
    spline = plan((1.0, (1.0, 0.0)), (2.0, (1.0, 0.0)), (3.0, (1.0, 0.0)), (4.0, (1.0, 0.0)))
    assert rows(spline) == [(0.0, [0.5, -0.5]), (1.0, [1.0, 0.0])]


@pytest.mark.parametrize(
    "waypoints",
    [
        ((0.0, (0.5, -0.5)),),
        ((3.0, (0.5, -0.5)),),
        ((0.0, (0.5, -0.5)), (1.0, (0.5, -0.5)), (2.0, (0.5, -0.5))),
        ((1.0, (0.5 + 5e-7, -0.5)), (2.0, (0.5, -0.5))),
    ],
)
def test_trajectory_at_present_position_needs_no_spline(
    waypoints: tuple[tuple[float, tuple[float, float]], ...],
) -> None:
    assert plan(*waypoints) is None


@pytest.mark.parametrize(
    "waypoints", [((0.0, (1.0, 0.0)),), ((0.0, (0.5, -0.5)), (0.0005, (1.0, 0.0))), ((1e-6, (1.0, 0.0)),)]
)
def test_trajectory_without_time_for_motion_is_rejected(
    waypoints: tuple[tuple[float, tuple[float, float]], ...],
) -> None:
    with pytest.raises(GoalRefused, match="no time to get") as caught:
        plan(*waypoints)
    assert caught.value.fault.code == GoalCode.INVALID_GOAL


def test_limits_are_off_by_zero_and_name_the_joint_else() -> None:
    way = ((0.0, (0.6, -0.5)), (1.0, (0.5, 1.5)))  # elbow: 2 rad in 1 s from rest to rest: 3 rad/s, 12 rad/s^2
    assert plan(*way) is not None
    for limits, words in (
        (replace(NO_LIMITS, max_start_deviation_rad=0.05), "shoulder is 0.1000 rad away"),
        (replace(NO_LIMITS, max_velocity_radps=(0.0, 2.9)), "elbow: velocity 3.000 rad/s along the path, at most 2.9"),
        (replace(NO_LIMITS, max_acceleration_radps2=(0.0, 11.9)), "elbow: acceleration 12.000 rad/s^2"),
    ):
        with pytest.raises(GoalRefused) as caught:
            plan(*way, limits=limits)
        assert caught.value.fault.code == GoalCode.INVALID_GOAL
        assert words in caught.value.fault.text
    generous = replace(
        NO_LIMITS, max_start_deviation_rad=0.11, max_velocity_radps=(0.1, 3.1), max_acceleration_radps2=(0.1, 12.1)
    )
    assert plan(*way, limits=generous) is not None


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from([1e-9, 5e-7, 2e-6, 9e-4, 0.01, 0.1, 0.5, 3.0]),
            st.sampled_from([0.0, 4e-7, 2e-6, 0.3, -1.0]),
            st.sampled_from([0.0, 4e-7, -0.2]),
        ),
        min_size=1,
        max_size=12,
    ),
    st.booleans(),
)
def test_the_engine_never_gets_what_it_refuses(steps: list[tuple[float, float, float]], from_zero: bool) -> None:
    times = np.cumsum([gap for gap, _, _ in steps]) - (steps[0][0] if from_zero else 0.0)
    positions = HERE + np.cumsum([(a, b) for _, a, b in steps], axis=0)
    try:
        spline = plan_spline(Waypoints(times, positions), 0.0, HERE, JOINTS, NO_LIMITS)
    except GoalRefused:
        assert np.abs(positions[-1] - HERE).max() > 1e-3
        return
    if spline is None:
        assert np.abs(positions[-1] - HERE).max() <= 1e-3
        return
    assert spline.times_s[0] == 0.0
    assert np.array_equal(spline.positions[0], HERE)
    assert np.diff(spline.times_s).min() > ENGINE_GAP_S
    assert np.abs(np.diff(spline.positions, axis=0)).max(axis=1).min() > ENGINE_SAME_RAD
    assert set(spline.times_s[1:].tolist()) <= set(times.tolist())

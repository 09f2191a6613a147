"""Goals: which are accepted, the order of joints, and the codes and texts of rejections."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.wmx.trajectory.goal import Goal, GoalLimits, Point, check_goal
from robot_stack.wmx.trajectory.results import GoalCode, GoalRefused
from robot_stack.wmx.trajectory.tolerances import JointTolerance

LIMITS = GoalLimits(
    ("a", "b", "c"),
    max_points=1000,
    max_start_delay_s=60.0,
    path_position_rad=0.2,
    goal_position_rad=0.01,
    goal_velocity_radps=0.05,
    goal_time_s=1.0,
)
GOOD = Goal(("a", "b", "c"), (Point((1.0, 2.0, 3.0), 0.5), Point((4.0, 5.0, 6.0), 1.5)))


def refusal(goal: Goal, now_s: float = 100.0) -> tuple[int, str]:
    with pytest.raises(GoalRefused) as caught:
        check_goal(goal, LIMITS, now_s)
    return caught.value.fault.code, caught.value.fault.text


def with_second(**fields: object) -> Goal:
    return replace(GOOD, points=(GOOD.points[0], replace(GOOD.points[1], **fields)))


def with_all(**fields: object) -> Goal:
    return replace(GOOD, points=tuple(replace(point, **fields) for point in GOOD.points))


def with_velocities(**fields: object) -> Goal:
    goal = with_all(velocities=(0.0, 0.0, 0.0))
    return replace(goal, points=(goal.points[0], replace(goal.points[1], **fields)))


def test_velocities_and_accelerations_are_those_of_their_joints() -> None:
    point = Point((1.0, 2.0, 3.0), 0.5, (0.1, 0.2, 0.3), (10.0, 20.0, 30.0))
    goal = Goal(("c", "a", "b"), (point, replace(point, time_s=1.5, velocities=(0.0, 0.0, 1e-8))))
    points = check_goal(goal, LIMITS, 100.0).points
    assert points.velocities is not None
    assert points.accelerations is not None
    assert points.velocities.tolist() == [[0.2, 0.3, 0.1], [0.0, 1e-8, 0.0]]
    assert points.accelerations.tolist() == [[20.0, 30.0, 10.0]] * 2
    assert check_goal(GOOD, LIMITS, 100.0).points.velocities is None


@given(st.permutations(range(3)))
def test_any_order_of_joints_means_the_same(order: list[int]) -> None:
    names = tuple(LIMITS.joints[i] for i in order)
    points = tuple(replace(p, positions=tuple(p.positions[i] for i in order)) for p in GOOD.points)
    goal = check_goal(Goal(names, points), LIMITS, 0.0)
    assert goal.points.positions.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    assert [goal.points.positions[0][column] for column in goal.order] == list(points[0].positions)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("a", "b", "x"), ("unknown: 'x'", "missing: 'c'")),
        (("a", "b"), ("missing: 'c'",)),
        (("a", "b", "b"), ("missing: 'c'", "named twice: 'b'")),
        (("a", "b", "c", "a"), ("named twice: 'a'",)),
        ((), ("missing: 'a', 'b', 'c'",)),
    ],
)
def test_wrong_joints(names: tuple[str, ...], words: tuple[str, ...]) -> None:
    code, text = refusal(replace(GOOD, joint_names=names))
    assert code == GoalCode.INVALID_JOINTS
    assert all(word in text for word in words), text


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        (with_second(positions=(1.0, 2.0)), "points[1].positions: 2 values for 3 joints"),
        (with_second(positions=()), "points[1].positions: 0 values"),
        (with_second(velocities=(1.0,)), "points[1].velocities: 1 values"),
        (with_second(accelerations=(1.0,) * 4), "points[1].accelerations: 4 values"),
        (with_second(effort=(1.0,) * 3), "points[1].effort: no efforts"),
        (with_second(velocities=(0.0,) * 3), "points[0].velocities: none, but points[1] has them"),
        (with_velocities(accelerations=(1.0,) * 3), "points[0].accelerations: none, but points[1] has them"),
        (with_all(accelerations=(0.0,) * 3), "points[0].accelerations: need velocities"),
        (with_velocities(velocities=(0.0, -1e-6, 0.0)), "points[1].velocities: b ends at -1e-06 rad/s, must be 0"),
        (with_second(positions=(1.0, math.nan, 0.0)), "points[1].positions: not finite"),
        (with_second(positions=(1.0, 0.0, math.inf)), "points[1].positions: not finite"),
        (with_second(velocities=(1.0, math.nan, 0.0)), "points[1].velocities: not finite"),
        (with_second(time_s=0.5), "points[1].time_from_start: 0.5 s does not come after 0.5 s"),
        (with_second(time_s=0.4), "points[1].time_from_start"),
        (replace(GOOD, points=(Point((0.0,) * 3, -0.1),)), "points[0].time_from_start: is negative"),
        (replace(GOOD, goal_time_s=-1.0), "goal_time_tolerance: is negative"),
        (replace(GOOD, multi_dof_joints=("base",)), "multi_dof_trajectory"),
        (replace(GOOD, stamp_s=161.0), "61.0 s in the future, at most 60 s"),
        (replace(GOOD, path_tolerance=(JointTolerance("b", position=-2.0),)), "path_tolerance: position of b is -2"),
        (
            replace(GOOD, goal_tolerance=(JointTolerance("b", velocity=math.nan),)),
            "goal_tolerance: velocity of b is nan",
        ),
    ],
)
def test_malformed_goals_are_refused_by_field(goal: Goal, words: str) -> None:
    code, text = refusal(goal)
    assert code == GoalCode.INVALID_GOAL
    assert words in text


def test_a_thousand_points_and_no_more() -> None:
    points = tuple(Point((0.0, 0.0, 0.0), float(i)) for i in range(1, 1002))
    assert len(check_goal(replace(GOOD, points=points[:1000]), LIMITS, 0.0).points) == 1000
    code, text = refusal(replace(GOOD, points=points))
    assert (code, "1001 points" in text, "1000" in text) == (GoalCode.INVALID_GOAL, True, True)


def test_no_points_need_no_joints() -> None:
    assert check_goal(Goal((), ()), LIMITS, 0.0).points.positions.shape == (0, 3)


def test_start_times() -> None:
    later = check_goal(replace(GOOD, stamp_s=103.0), LIMITS, 100.0)
    assert (later.start_in_s, later.late_s) == (pytest.approx(3.0), 0.0)
    under_way = check_goal(replace(GOOD, stamp_s=99.0), LIMITS, 100.0)
    assert (under_way.start_in_s, under_way.late_s) == (0.0, pytest.approx(1.0))
    now = check_goal(replace(GOOD, stamp_s=100.0), LIMITS, 100.0)
    assert (now.start_in_s, now.late_s) == (0.0, 0.0)
    code, text = refusal(replace(GOOD, stamp_s=98.0))
    assert code == GoalCode.OLD_HEADER_TIMESTAMP
    assert "ended 0.500 s ago" in text


def test_unknown_joint_of_a_tolerance() -> None:
    code, text = refusal(replace(GOOD, path_tolerance=(JointTolerance("x", 0.1),)))
    assert (code, "path_tolerance: unknown joint 'x'" in text) == (GoalCode.INVALID_JOINTS, True)


def test_tolerances_default_none_and_given() -> None:
    given_ = (JointTolerance("a", position=0.1, velocity=0.2), JointTolerance("b", position=-1.0))
    goal = check_goal(replace(GOOD, goal_tolerance=given_, goal_time_s=2.5), LIMITS, 0.0)
    assert goal.goal_time_s == 2.5
    assert goal.at_goal.position.tolist() == [0.1, np.inf, 0.01]
    assert goal.at_goal.velocity.tolist() == [0.2, 0.05, 0.05]
    assert goal.path.position.tolist() == [0.2, 0.2, 0.2]
    assert np.isinf(goal.path.velocity).all()
    free = (JointTolerance("a", position=-1.0, velocity=-1.0),)
    goal = check_goal(replace(GOOD, path_tolerance=free, goal_tolerance=free), LIMITS, 0.0)
    assert goal.path.position.tolist() == [np.inf, 0.2, 0.2]
    assert goal.at_goal.velocity.tolist() == [np.inf, 0.05, 0.05]
    off = replace(LIMITS, path_position_rad=0.0, goal_position_rad=0.0, goal_velocity_radps=0.0)
    goal = check_goal(GOOD, off, 0.0)
    for tolerances in (goal.path, goal.at_goal):
        assert np.isinf([tolerances.position, tolerances.velocity]).all()

"""Routes on known grids."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from robot_stack.core.distance_field import clearance_field
from robot_stack.core.geometry import Pose2, wrap_angle
from robot_stack.core.robot import Footprint
from robot_stack.core.site_map import FREE, OCCUPIED, UNKNOWN, Grid
from robot_stack.navigation.cancel_flag import CancelFlag
from robot_stack.navigation.footprint import outline
from robot_stack.navigation.global_planner import GlobalPlanner, NoWay, goal_problem
from robot_stack.navigation.params import PlannerParams
from robot_stack.navigation.path import Path
from robot_stack.navigation.planning_grid import PlanningGrid
from robot_stack.navigation.tight_passage import passage
from tests.unit.navigation.plant import ROBOT, params

START, GOAL = Pose2(2.0, 5.0, 0.0), Pose2(13.0, 5.0, 0.0)


def grid(rows: int = 100, columns: int = 150) -> np.ndarray:
    return np.full((rows, columns), FREE, np.int8)


def planner(cells: np.ndarray, **changes: object) -> GlobalPlanner:
    settings_of: PlannerParams = params().planner.model_copy(update=changes)
    return GlobalPlanner(PlanningGrid(Grid(0.1, 0.0, 0.0, cells)), settings_of)


def route(cells: np.ndarray, footprint: Footprint = ROBOT.footprint, goal: Pose2 = GOAL, **changes: object) -> Path:
    found = planner(cells, **changes).plan(START, goal, footprint)
    assert isinstance(found, Path), found
    return found


def wall_with_gate(width_m: float, middle_m: float = 5.0) -> np.ndarray:
    cells = grid()
    half = round(width_m * 5)
    cells[:, 75] = OCCUPIED
    cells[round(middle_m * 10) - half : round(middle_m * 10) + half, 75] = FREE
    return cells


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_distances_are_exact(seed: int) -> None:
    occupied = np.random.default_rng(seed).random((31, 23)) < 0.03
    truth = ndimage.distance_transform_edt(~occupied) * 0.1 if occupied.any() else np.full(occupied.shape, 9.0)
    assert np.allclose(clearance_field(occupied, 0.1, 2.0), np.minimum(truth, 2.0), atol=1e-5)


def test_a_start_beside_a_thin_wall_leads_around_it() -> None:
    cells = np.full((400, 800), FREE, np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = OCCUPIED
    cells[200, :600] = OCCUPIED
    by_grid = GlobalPlanner(PlanningGrid(Grid(0.05, 0.0, 0.0, cells)), params().planner)
    start = Pose2(5.0, 10.0 - 0.5 * ROBOT.footprint.width_m - 0.2, 0.0)
    found = by_grid.plan(start, Pose2(5.0, 12.0, 0.0), ROBOT.footprint)
    assert isinstance(found, Path), found
    assert found.length_m > 50.0


def test_empty_grid_gives_the_straight_line() -> None:
    for angle in (0.0, 0.5, 1.3):
        goal = Pose2(START.x + 4.0 * math.cos(angle), START.y + 4.0 * math.sin(angle), 0.0)
        assert route(grid(), goal=goal).length_m == pytest.approx(4.0, rel=1e-6)
    short = route(grid(), goal=Pose2(2.0, 5.8, 0.0)).poses
    assert np.abs(short[:, 2]).max() < 0.2, "a short step to the side is driven sideways"


def test_begins_and_ends_exactly_and_looks_ahead() -> None:
    found = route(grid(), goal=Pose2(12.03, 8.07, 1.0)).poses
    assert found[0] == pytest.approx((START.x, START.y, START.yaw))
    assert found[-1] == pytest.approx((12.03, 8.07, 1.0))
    course = math.atan2(3.07, 10.03)
    assert abs(wrap_angle(found[len(found) // 2, 2] - course)) < 0.02


def test_gate_is_passed_in_its_middle() -> None:
    poses = route(wall_with_gate(1.3, 6.5)).poses
    at = poses[np.argmin(abs(poses[:, 0] - 7.55))]
    # The gate's free cells reach from 5.8 (58 * 0.1) to 7.2, minus the rounding of 1.3 m to cells.
    assert at[1] == pytest.approx(6.5, abs=0.15)
    assert abs(at[2]) < 0.5
    for footprint in (ROBOT.footprint, ROBOT.footprint_with_chair):
        plan = planner(wall_with_gate(1.4, 8.0))
        found = plan.plan(START, GOAL, footprint)
        assert isinstance(found, Path)
        assert plan.grid.clearance_m(outline(footprint), found.poses).min() >= 0.05


def test_too_narrow_for_the_chair_but_not_for_the_robot() -> None:
    cells = wall_with_gate(1.0)
    # The chair needs 0.8 m, 0.08 m to either side, and half a cell.
    assert route(wall_with_gate(1.2)).length_m < 11.5
    found = planner(cells).plan(START, GOAL, ROBOT.footprint_with_chair)
    assert isinstance(found, NoWay)
    assert "no path" in found.reason or "too narrow" in found.reason


def test_plan_across_closed_wall_returns_no_way() -> None:
    cells = grid()
    cells[:, 75] = OCCUPIED
    found = planner(cells).plan(START, GOAL, ROBOT.footprint)
    assert isinstance(found, NoWay)
    assert "no path from (2.0, 5.0) to (13.0, 5.0)" in found.reason
    ends = np.array([5.0, 5.0, 0.0]), np.array([10.0, 5.0, 0.0])
    made = PlanningGrid(Grid(0.1, 0.0, 0.0, cells))
    assert passage(made, ROBOT.footprint, params().planner, *ends, CancelFlag(), any_heading=True) is None
    assert isinstance(planner(grid()).plan(Pose2(math.nan, 0.0, 0.0), GOAL, ROBOT.footprint), NoWay)
    tight = grid()
    tight[50, 26] = OCCUPIED  # 0.15 m ahead of the front
    assert isinstance(planner(tight).plan(START, GOAL, ROBOT.footprint), Path)


def test_the_wider_of_two_gates_is_worth_a_small_detour() -> None:
    cells = grid()
    cells[:, 65:85] = OCCUPIED
    cells[44:56, 65:85] = FREE
    cells[62:90, 65:85] = FREE
    poses = route(cells).poses
    assert poses[np.argmin(abs(poses[:, 0] - 7.55)), 1] > 6.2


def test_unknown_is_dear_or_closed() -> None:
    cells = grid()
    cells[20:80, 60:90] = UNKNOWN
    direct = 11.0
    assert route(cells, unknown_cost=1.0).length_m == pytest.approx(direct, rel=1e-3)
    assert route(cells, unknown_cost=9.0).length_m > direct + 0.5
    cells[:, 60:90] = UNKNOWN
    assert route(cells).length_m == pytest.approx(direct, rel=1e-3)
    assert isinstance(planner(cells, unknown_is_passable=False).plan(START, GOAL, ROBOT.footprint), NoWay)


def test_seen_obstacle_counts_until_it_is_cleared() -> None:
    plan = planner(grid())
    ys = np.arange(3.0, 7.0, 0.05)
    plan.grid.lay_over(np.column_stack((np.full(len(ys), 7.5), ys)))
    around = plan.plan(START, GOAL, ROBOT.footprint)
    assert isinstance(around, Path)
    assert around.length_m > 11.5
    plan.grid.lay_over(np.empty((0, 2)))
    straight = plan.plan(START, GOAL, ROBOT.footprint)
    assert isinstance(straight, Path)
    assert straight.length_m == pytest.approx(11.0, rel=1e-6)


@pytest.mark.parametrize(
    ("goal", "reason"),
    [
        (Pose2(-1.0, 5.0, 0.0), "outside the map"),
        (Pose2(7.5, 2.0, 0.0), "limit 0.03 m"),
        (Pose2(7.0, 2.0, 0.0), "limit 0.03 m"),  # the front reaches into the wall
    ],
)
def test_goals_without_clearance_are_refused(goal: Pose2, reason: str) -> None:
    site = PlanningGrid(Grid(0.1, 0.0, 0.0, wall_with_gate(1.3)))
    assert goal_problem(site, ROBOT.footprint, GOAL, params().planner) is None
    problem = goal_problem(site, ROBOT.footprint, goal, params().planner)
    assert problem is not None
    assert reason in problem.text


def corridor_with_gate() -> np.ndarray:
    """Returns a corridor of 1.7 m with a gate at a right angle: the chair cannot turn at the bend."""
    cells = grid()
    cells[:, 57] = cells[:, 75] = OCCUPIED
    cells[80:93, 75] = FREE
    cells[94:, :] = OCCUPIED
    return cells


def test_gate_in_a_corner_is_entered_forward_and_in_line() -> None:
    chair, start = ROBOT.footprint_with_chair, Pose2(6.4, 2.0, 0.5 * math.pi)
    made = planner(corridor_with_gate())
    found = made.plan(start, Pose2(13.0, 2.0, -1.2), chair)
    assert isinstance(found, Path), found
    assert tuple(found.poses[0]) == pytest.approx((start.x, start.y, start.yaw))
    assert tuple(found.poses[-1]) == pytest.approx((13.0, 2.0, -1.2))
    clear = made.grid.clearance_m(outline(chair), found.poses)
    margin_m = params().planner.margin_m + made.grid.half_cell_m
    far_from_ends = (found.arc_length_m > 1.0) & (found.arc_length_m < found.length_m - 1.0)
    assert clear[far_from_ends].min() >= margin_m - 1e-6
    inside = np.abs(found.poses[:, 0] - 7.55) < 0.5
    assert inside.any()
    assert np.abs(found.poses[inside, 2]).max() < 0.6  # forward


def test_passage_between_poses_turns_along_the_path_and_keeps_its_ends() -> None:
    cells = grid()
    made = PlanningGrid(Grid(0.1, 0.0, 0.0, cells))
    start, goal = np.array([3.0, 5.0, 3.0]), np.array([6.0, 5.5, -3.0])
    found = passage(made, ROBOT.footprint, params().planner, start, goal, CancelFlag(), any_heading=False)
    assert found is not None
    assert np.allclose(found[0], start)
    assert np.allclose(found[-1, :2], goal[:2])
    assert math.isclose(wrap_angle(found[-1, 2] - goal[2]), 0.0, abs_tol=1e-9)
    assert np.abs(np.diff(found[:, 2])).max() < 0.2
    assert np.hypot(*np.diff(found[:, :2], axis=0).T).max() < 0.2


def test_a_route_stays_inside_a_map_whose_edge_has_no_obstacles() -> None:
    """Beside an obstacle that leaves 1.3 m to the edge, and more than the preferred distance in the middle of them."""
    bounded = PlanningGrid(Grid(0.05, 0.0, 0.0, np.full((120, 120), FREE, np.int8)))
    x, y = np.meshgrid(np.arange(0.0, 4.7, 0.05), (3.0, 3.05))
    bounded.lay_over(np.column_stack((x.ravel(), y.ravel())))
    found = GlobalPlanner(bounded, params().planner).plan(Pose2(3.0, 1.0, 0.0), Pose2(3.0, 5.0, 0.0), ROBOT.footprint)
    assert isinstance(found, Path)
    assert bounded.clearance_m(outline(ROBOT.footprint), found.poses).min() >= params().planner.margin_m

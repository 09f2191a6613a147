"""One-way zones: routes and motions along their heading, and how far the robot may go back in them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from robot_stack.core.geometry import Pose2
from robot_stack.core.site_map import FREE, OCCUPIED, Grid
from robot_stack.core.zones import Zone, ZoneType
from robot_stack.navigation.cancel_flag import CancelFlag
from robot_stack.navigation.global_planner import GlobalPlanner, NoWay
from robot_stack.navigation.one_way import against_m, coarse_courses, course_of, limit_rad, permits, permitted
from robot_stack.navigation.path import Path
from robot_stack.navigation.planning_grid import PlanningGrid
from robot_stack.navigation.states import NavigationState
from robot_stack.navigation.tight_passage import passage
from tests.unit.navigation.plant import ROBOT, params
from tests.unit.navigation.test_among_obstacles import Story, box, nothing, reached

Array = npt.NDArray[np.float64]
TOLERANCE_RAD = params().one_way.tolerance_rad
BACK_M, ESCAPE_M = params().one_way.back_m, params().planner.escape_m
WEST, EAST = Pose2(2.0, 5.0, 0.0), Pose2(18.0, 5.0, 0.0)


def one_way(deg: float, x0: float, x1: float, y0: float, y1: float) -> Zone:
    ring = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)])
    return Zone(f"lane {deg:.0f}", ZoneType.ONE_WAY, (ring,), np.inf, math.radians(deg))


def island() -> Grid:
    """20 m x 10 m with a block in the middle, x 6 to 14: corridors of 3 m below and above it."""
    cells = np.full((100, 200), FREE, np.int8)
    cells[[0, -1]] = OCCUPIED
    cells[:, [0, -1]] = OCCUPIED
    cells[30:70, 60:140] = OCCUPIED
    return Grid(0.1, 0.0, 0.0, cells)


LOWER_EAST = one_way(0.0, 5.0, 15.0, 0.0, 3.0)
UPPER_WEST = one_way(180.0, 5.0, 15.0, 7.0, 10.0)


def planned(start: Pose2, goal: Pose2, *zones: Zone, grid: Grid | None = None) -> Path | NoWay:
    grid = grid or island()
    courses = permitted(zones, grid, TOLERANCE_RAD)
    return GlobalPlanner(PlanningGrid(grid, courses=courses), params().planner).plan(start, goal, ROBOT.footprint)


def side(path: Path | NoWay) -> str:
    """Which corridor a path uses."""
    assert isinstance(path, Path), path
    y = path.poses[np.abs(path.poses[:, 0] - 10.0) < 1.0, 1]
    assert len(y)
    return "lower" if y.max() < 5.0 else "upper"


def test_each_direction_uses_the_corridor_that_permits_it() -> None:
    for start, goal, side_of in ((WEST, EAST, "lower"), (EAST, WEST, "upper")):
        path = planned(start, goal, LOWER_EAST, UPPER_WEST)
        assert side(path) == side_of
        assert isinstance(path, Path)
        assert against_m((LOWER_EAST, UPPER_WEST), path.poses[:, :2], TOLERANCE_RAD) == 0.0


@pytest.mark.parametrize(("deg", "y_m"), [(0.0, 1.5), (180.0, 8.5)])
def test_a_single_zone_moves_the_traffic_against_it_to_the_other_corridor(deg: float, y_m: float) -> None:
    low = 0.0 if y_m < 5.0 else 7.0
    lane = one_way(deg, 5.0, 15.0, low, low + 3.0)
    near, far = ("lower", "upper") if y_m < 5.0 else ("upper", "lower")
    start, goal = Pose2(2.0, y_m, 0.0), Pose2(18.0, y_m, 0.0)
    assert side(planned(start, goal, lane)) == (near if deg == 0.0 else far)
    assert side(planned(goal, start, lane)) == (far if deg == 0.0 else near)


def test_a_robot_inside_leaves_along_the_heading_and_none_goes_where_no_way_is_permitted() -> None:
    path = planned(Pose2(10.0, 1.5, 0.0), WEST, LOWER_EAST)
    assert isinstance(path, Path)
    assert path.length_m > 16.0
    assert path.poses[:, 0].max() > 14.5
    assert against_m((LOWER_EAST,), path.poses[:, :2], TOLERANCE_RAD) == 0.0
    assert isinstance(planned(EAST, WEST, LOWER_EAST, one_way(0.0, 5.0, 15.0, 7.0, 10.0)), NoWay)


@pytest.mark.parametrize("deg", [0.0, 72.0, 260.0])
def test_routes_of_any_course_keep_to_the_zones(deg: float) -> None:
    """An open field with a zone: a route is either permitted, or leads around it."""
    cells = np.full((200, 200), FREE, np.int8)
    lane = one_way(deg, 7.0, 13.0, 7.0, 13.0)
    for course in np.radians(np.arange(0.0, 360.0, 30.0)):
        dx, dy = 8.0 * math.cos(course), 8.0 * math.sin(course)
        start, goal = Pose2(10.0 - dx, 10.0 - dy, 0.0), Pose2(10.0 + dx, 10.0 + dy, 0.0)
        path = planned(start, goal, lane, grid=Grid(0.1, 0.0, 0.0, cells))
        assert isinstance(path, Path), path
        assert against_m((lane,), path.poses[:, :2], limit_rad(TOLERANCE_RAD)) == 0.0
        off = abs(math.remainder(course - math.radians(deg), 2.0 * math.pi))
        if abs(off - TOLERANCE_RAD) > 0.2:
            assert (path.length_m < 16.2) == (off < TOLERANCE_RAD)


def test_a_robot_at_the_entrance_may_back_out_but_not_farther() -> None:
    """No other way is left: the lane ends at a wall."""
    grid = island()
    grid.occupancy[0:30, 140:145] = OCCUPIED
    lane = one_way(0.0, 7.0, 15.0, 0.0, 3.0)
    near, far = Pose2(7.0 + ESCAPE_M - 0.3, 1.5, 0.0), Pose2(7.0 + ESCAPE_M + 0.5, 1.5, 0.0)
    backs_out = planned(near, WEST, lane, grid=grid)
    assert isinstance(backs_out, Path)
    assert 0.0 < against_m((lane,), backs_out.poses[:, :2], TOLERANCE_RAD) <= ESCAPE_M
    assert isinstance(planned(far, WEST, lane, grid=grid), NoWay)


def test_a_way_back_is_planned_in_a_circle_whatever_its_course() -> None:
    """The corners of a square of cells would be farther away than the robot may go back."""
    grid = Grid(0.1, 0.0, 0.0, np.full((400, 400), FREE, np.int8))
    c = math.sqrt(0.5)
    turn = np.array([(c, c), (-c, c)])  # rows: along and across the heading of 45 deg
    ring = np.array([(0.0, -11.0), (24.0, -11.0), (24.0, 11.0), (0.0, 11.0), (0.0, -11.0)]) @ turn + (10.0, 10.0)
    lane = Zone("lane", ZoneType.ONE_WAY, (ring,), np.inf, math.radians(45.0))
    for inside_m, backs in ((0.5, True), (1.0, False)):
        x, y = np.array([(inside_m, 0.0), (-3.0, 0.0)]) @ turn + (10.0, 10.0)
        path = planned(Pose2(x[0], x[1], 0.8), Pose2(y[0], y[1], 0.8), lane, grid=grid)
        assert isinstance(path, Path)
        assert (path.length_m < 5.0) == backs
        assert against_m((lane,), path.poses[:, :2], limit_rad(TOLERANCE_RAD)) <= ESCAPE_M


def test_only_a_passage_from_the_robot_leads_back() -> None:
    cells = np.full((100, 200), FREE, np.int8)
    cells[:42] = cells[58:] = OCCUPIED
    lane = one_way(0.0, 10.0, 20.0, 0.0, 10.0)
    raw = Grid(0.1, 0.0, 0.0, cells)
    grid = PlanningGrid(raw, courses=permitted((lane,), raw, TOLERANCE_RAD))
    ends = np.array([(10.5, 5.0, 0.0), (9.5, 5.0, 0.0)])
    found = [
        passage(
            grid, ROBOT.footprint, params().planner, ends[0], ends[1], CancelFlag(), any_heading=False, escapes=escapes
        )
        for escapes in (True, False)
    ]
    assert found[0] is not None
    assert found[1] is None


def test_courses_of_cells() -> None:
    grid = Grid(1.0, 0.0, 0.0, np.zeros((4, 4), np.int8))
    courses = permitted((one_way(90.0, 0.0, 2.0, 0.0, 4.0), one_way(0.0, 0.0, 4.0, 0.0, 1.0)), grid, TOLERANCE_RAD)
    up, down, right, left = course_of(0.0, 1.0), course_of(0.0, -1.0), course_of(1.0, 0.0), course_of(-1.0, 0.0)
    assert [permits(courses, 2, 0, course) for course in (up, down, right, left)] == [True, False, True, True]
    assert [permits(courses, 0, 3, course) for course in (up, down, right, left)] == [True, True, True, False]
    assert [permits(courses, 0, 0, course) for course in (up, down, right, left)] == [True, False, True, False]
    assert all(permits(courses, 3, 3, course) for course in range(32))
    assert [permits(coarse_courses(courses, 4), 0, 0, course) for course in (up, down, left)] == [True, False, False]
    assert permitted((), grid, TOLERANCE_RAD).size == 0


def test_the_robot_goes_by_one_corridor_and_returns_by_the_other() -> None:
    zones = (LOWER_EAST, UPPER_WEST)
    story = Story(box(9.5, 10.0, 8.2, 8.6), island(), zones=zones)
    for goal in (EAST, WEST):
        assert story.go(goal) == ""
        story.until(reached)
    way = np.array([(pose.x, pose.y) for pose in story.poses])
    turn = int(np.argmax(way[:, 0]))
    assert way[:turn][np.abs(way[:turn, 0] - 10.0) < 1.0, 1].max() < 3.0
    assert way[turn:][np.abs(way[turn:, 0] - 10.0) < 1.0, 1].min() > 7.0
    assert against_m(zones, way, TOLERANCE_RAD) < 0.05


def test_a_goal_shortly_behind_the_robot_is_reached_and_one_farther_behind_is_not() -> None:
    cells = np.full((40, 200), FREE, np.int8)
    cells[[0, -1]] = OCCUPIED
    grid, lane = Grid(0.1, 0.0, 3.0, cells), one_way(0.0, -1.0, 21.0, 2.0, 8.0)
    story = Story(nothing, grid, zones=(lane,))
    story.go(Pose2(2.0 - 0.6 * BACK_M, 5.0, 0.0))
    story.until(reached)
    story = Story(nothing, grid, zones=(lane,))
    story.drive.pose = Pose2(8.0, 5.0, 0.0)
    story.go(Pose2(5.0, 5.0, 0.0))
    end = story.until(lambda output: output.state is NavigationState.IDLE)
    assert not end.reached
    assert min(pose.x for pose in story.poses) > 8.0 - BACK_M - 0.1


def test_short_goals_one_after_another_lead_no_farther_back_than_one() -> None:
    cells = np.full((40, 200), FREE, np.int8)
    cells[[0, -1]] = OCCUPIED
    story = Story(nothing, Grid(0.1, 0.0, 3.0, cells), zones=(one_way(0.0, -1.0, 21.0, 2.0, 8.0),))
    story.drive.pose = Pose2(8.0, 5.0, 0.0)
    for back_m in (0.6, 1.2, 1.8):
        story.go(Pose2(8.0 - back_m, 5.0, 0.0))
        story.until(lambda output: output.state is NavigationState.IDLE)
    assert 8.0 - BACK_M - 0.15 < min(pose.x for pose in story.poses) < 7.45
    story.go(Pose2(9.5, 5.0, 0.0))
    story.until(reached)
    story.go(Pose2(9.0, 5.0, 0.0))
    story.until(reached)  # a way back again after the way forward


def test_a_course_at_the_limit_is_driven_to_its_end() -> None:
    """Of the permitted courses, the one farthest off the zone's heading."""
    grid = Grid(0.1, -15.0, -5.0, np.full((250, 300), FREE, np.int8))
    story = Story(nothing, grid, zones=(one_way(4.0, -30.0, 30.0, 0.0, 7.0),))
    story.drive.pose = Pose2(0.0, 0.5, 2.0)
    story.go(Pose2(-6.0, 12.0, 2.0))
    story.until(reached)


def test_a_robot_that_makes_room_goes_back_no_farther_than_permitted() -> None:
    """A person walks at the robot in a lane that leaves no room beside it."""

    def walker(now_s: float, x: Array, y: Array) -> npt.NDArray[np.bool_]:
        return np.hypot(x - max(10.0 - 0.3 * (now_s - 10.0), 3.0), y - 5.0) < 0.25

    cells = np.full((100, 200), FREE, np.int8)
    cells[:42] = cells[58:] = OCCUPIED
    grid = Grid(0.1, 0.0, 0.0, cells)

    def farthest_back_m(*zones: Zone) -> float:
        story = Story(walker, grid, zones=zones)
        story.drive.pose = Pose2(7.0, 5.0, 0.0)
        story.go(Pose2(18.0, 5.0, 0.0))
        for _ in range(360):
            story.tick()
        x = np.array([pose.x for pose in story.poses])
        return float((np.maximum.accumulate(x) - x).max())

    assert farthest_back_m() > BACK_M + 0.3, "without the zone the robot makes more room"
    assert farthest_back_m(one_way(0.0, 0.0, 20.0, 0.0, 10.0)) < BACK_M + 0.15

"""Long routes over the lanes of a site's route graph."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from robot_stack.core.config import ConfigError, load
from robot_stack.core.departure import Departure, DepartureParams
from robot_stack.core.distance_field import clearance_field
from robot_stack.core.geometry import Pose2
from robot_stack.core.route_graph import RouteGraph
from robot_stack.core.site_map import FREE, OCCUPIED, Grid
from robot_stack.navigation.cancel_flag import CancelFlag
from robot_stack.navigation.controller import NavigationController
from robot_stack.navigation.lanes import Lanes
from robot_stack.navigation.path import Path
from robot_stack.navigation.planning_grid import FAR_M, PlanningGrid
from robot_stack.navigation.routes import PromptRoutes, RouteRequest, RouteSolver
from tests.unit.navigation.plant import ROBOT, params
from tests.unit.navigation.test_among_obstacles import Story, nothing

Array = npt.NDArray[np.float64]
CRUISE_MPS = params().limits.cruise_speed_mps
WEST, EAST = Pose2(3.0, 10.0, 0.0), Pose2(27.0, 10.0, 0.0)


def hall() -> Grid:
    """30 m x 20 m, free."""
    cells = np.full((200, 300), FREE, np.int8)
    cells[[0, -1]] = OCCUPIED
    cells[:, [0, -1]] = OCCUPIED
    return Grid(0.1, 0.0, 0.0, cells)


# A ring of lanes: along y = 4 to the east, along y = 16 to the west, and a two-way lane along x = 15.
POINTS = ((4.0, 4.0), (15.0, 4.0), (26.0, 4.0), (26.0, 16.0), (15.0, 16.0), (4.0, 16.0))
RING = ((0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0), (1, 4), (4, 1))


def graph_of(
    edges: tuple[tuple[int, int], ...] = RING,
    *,
    fixed_m: dict[int, float] | None = None,
    speeds: dict[int, float] | None = None,
) -> RouteGraph:
    count = len(edges)
    cost_m, speed_mps = np.full(count, np.nan), np.full(count, np.inf)
    for edge, cost in (fixed_m or {}).items():
        cost_m[edge] = cost
    for edge, speed in (speeds or {}).items():
        speed_mps[edge] = speed
    ids = np.arange(100, 100 + count)
    return RouteGraph(np.array(POINTS), np.array(edges), ids, cost_m, speed_mps, np.ones(count))


def lanes_of(graph: RouteGraph) -> Lanes:
    return Lanes(graph, params().graph, CRUISE_MPS)


def test_a_share_of_the_speed_that_no_robot_can_drive_is_an_error() -> None:
    graph = graph_of()
    graph.speed_share[2] = 0.099 / CRUISE_MPS
    with pytest.raises(ConfigError, match=r"edge 102: speed_limit is 0\.099 m/s"):
        lanes_of(graph)
    graph.speed_share[2] = 0.101 / CRUISE_MPS
    assert lanes_of(graph).speed_mps[2] == pytest.approx(0.101)


def test_the_guide_of_a_lane_is_computed_around_it_only(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes: list[tuple[int, ...]] = []

    def measured(on: npt.NDArray[np.bool_], resolution_m: float, most_m: float) -> npt.NDArray[np.float32]:
        sizes.append(on.shape)
        return clearance_field(on, resolution_m, most_m)

    monkeypatch.setattr("robot_stack.navigation.lanes.clearance_field", measured)
    grid = PlanningGrid(hall())
    guide = lanes_of(graph_of()).piece_guide(grid, np.array([(15.0, 10.0), (17.0, 10.0)]))
    assert sizes == [(61, 81)], "3 m around the lane, in cells of 0.1 m"
    inside = {(row, column) for row, column in np.argwhere(guide >= 0.0)}
    near = {(row, column) for row in range(200) for column in range(300) if _from_lane_m(row, column) <= 1.0}
    assert len(inside ^ near) <= 4, "but for cells at the band's edge"


def _from_lane_m(row: int, column: int) -> float:
    return math.hypot(max(150 - column, 0, column - 170) / 10.0, (row - 100) / 10.0)


def test_a_band_must_be_narrower_than_the_distances_that_are_computed() -> None:
    with pytest.raises(ConfigError, match="band_m"):
        params(graph=params().graph.model_dump() | {"band_m": FAR_M})


def solved(start: Pose2, goal: Pose2, graph: RouteGraph, seen: Array | None = None) -> Array:
    """(n, 2) of the route."""
    solver = RouteSolver(params().planner, PlanningGrid(hall()), lanes_of(graph))
    points = np.empty((0, 2)) if seen is None else seen
    answer = solver.solve(RouteRequest(start, goal, ROBOT.footprint, points), CancelFlag())
    assert isinstance(answer.route, Path), answer.reason
    return np.asarray(answer.route.poses[:, :2])


def wall(x0: float, x1: float, y0: float, y1: float) -> Array:
    """Points of a seen obstacle."""
    x, y = np.meshgrid(np.arange(x0, x1, 0.1), np.arange(y0, y1, 0.1))
    return np.column_stack((x.ravel(), y.ravel()))


def at_x(route: Array, x_m: float) -> float:
    """y of the route where it first comes to x."""
    return float(route[int(np.argmin(np.abs(route[:, 0] - x_m))), 1])


def test_start_and_goal_are_connected_to_the_nearest_points_of_lanes() -> None:
    route = lanes_of(graph_of()).route(np.array((8.0, 2.0)), np.array((20.0, 3.0)), frozenset())
    assert route is not None
    assert route.lanes.tolist() == [0, 1]
    assert route.points.tolist() == [[8.0, 4.0], [15.0, 4.0], [20.0, 4.0]]
    on_one = lanes_of(graph_of()).route(np.array((5.0, 3.0)), np.array((14.0, 3.0)), frozenset())
    assert on_one is not None
    assert on_one.lanes.tolist() == [0]
    assert on_one.points.tolist() == [[5.0, 4.0], [14.0, 4.0]]


def test_lanes_are_driven_in_their_direction() -> None:
    route = lanes_of(graph_of()).route(np.array((12.8, 3.0)), np.array((6.2, 3.0)), frozenset())
    assert route is not None
    assert route.lanes.tolist() == [0, 6, 4, 5, 0]


def test_closed_lanes_costs_and_speeds_change_the_route() -> None:
    start, goal = np.array((4.0, 3.5)), np.array((26.0, 14.0))
    assert lanes_of(graph_of()).route(start, goal, frozenset()).lanes.tolist() == [0, 1, 2]  # type: ignore[union-attr]
    both = (*RING, (4, 3), (3, 2))
    over_middle = [0, 6, 8, 9]

    def lanes(graph: RouteGraph, *closed: int) -> list[int]:
        route = lanes_of(graph).route(start, goal, frozenset(closed))
        return [] if route is None else route.lanes.tolist()

    assert lanes(graph_of(both), 1) == over_middle
    assert lanes(graph_of(both, fixed_m={1: 500.0})) == over_middle
    assert lanes(graph_of(both, speeds={1: 0.2})) == over_middle
    assert lanes(graph_of(), 1) == [0], "no lane leads to the goal's own: as near as the others lead"


def test_no_lanes_for_a_near_goal_or_one_nearer_than_they_are() -> None:
    lanes = lanes_of(graph_of())
    assert lanes.route(np.array((5.0, 4.0)), np.array((10.0, 4.0)), frozenset()) is None
    assert lanes.route(np.array((1.0, 10.0)), np.array((9.0, 10.0)), frozenset({5})) is None
    far = Lanes(graph_of(), params().graph.model_copy(update={"access_m": 1.0}), CRUISE_MPS)
    assert far.route(np.array((1.0, 10.0)), np.array((28.0, 10.0)), frozenset()) is None


def test_limited_lanes_are_speed_zones() -> None:
    (zone,) = lanes_of(graph_of(speeds={1: 0.4})).speed_zones()
    assert (zone.name, zone.speed_mps) == ("edge 101", 0.4)
    x, y = np.array([20.0, 20.0, 10.0]), np.array([4.5, 5.5, 4.0])
    assert zone.contains(x, y).tolist() == [True, False, False]


def test_a_route_follows_the_lanes() -> None:
    route = solved(WEST, EAST, graph_of())
    assert abs(at_x(route, 10.0) - 4.0) < 0.3
    assert abs(at_x(route, 20.0) - 4.0) < 0.3
    assert route[-1].tolist() == [27.0, 10.0]
    back = solved(EAST, WEST, graph_of())
    assert abs(at_x(back, 20.0) - 16.0) < 0.3
    assert abs(at_x(back, 10.0) - 16.0) < 0.3


def test_an_obstacle_on_a_lane_is_passed_within_the_band() -> None:
    route = solved(WEST, EAST, graph_of(), wall(9.0, 9.5, 3.9, 4.1))
    beside = at_x(route, 9.2)
    assert 0.3 < abs(beside - 4.0) <= params().graph.band_m


def test_another_route_over_the_graph_is_taken_around_a_blocked_lane() -> None:
    both_ways = (*RING, (4, 3), (3, 2))
    route = solved(WEST, EAST, graph_of(both_ways), wall(20.0, 20.5, 1.0, 7.0))
    assert abs(at_x(route, 10.0) - 4.0) < 0.3
    assert abs(at_x(route, 20.0) - 16.0) < 0.3
    at_middle = route[np.abs(route[:, 1] - 10.0) < 1.0]
    assert np.abs(at_middle[(at_middle[:, 0] > 10.0) & (at_middle[:, 0] < 20.0), 0] - 15.0).max() < 0.3


# East along y = 4, north along x = 26, and from (26, 10) either on to the north or around by the west.
CORNER = np.array([(4.0, 4.0), (26.0, 4.0), (26.0, 10.0), (26.0, 16.0), (14.0, 10.0), (14.0, 16.0)])


def around_the_corner(wall_m: float, seen: Array, ahead_m: float = math.nan) -> Array:
    """(n, 2) route of a chair from the first node to the north. wall_m: from x = 26 to the wall in the east.

    ahead_m: cost of the lane north of (26, 10).
    """
    edges = np.array([(0, 1), (1, 2), (2, 3), (2, 4), (4, 5), (5, 3)])
    cost_m = np.where(np.arange(6) == 2, ahead_m, math.nan)
    graph = RouteGraph(CORNER, edges, np.arange(6), cost_m, np.full(6, np.inf), np.ones(6))
    cells = hall().occupancy[:, : round((26.0 + wall_m) / 0.1)].copy()
    cells[:, -1] = OCCUPIED
    solver = RouteSolver(params().planner, PlanningGrid(Grid(0.1, 0.0, 0.0, cells)), lanes_of(graph))
    request = RouteRequest(Pose2(4.0, 4.0, 0.0), Pose2(26.0, 15.5, 0.5 * math.pi), ROBOT.footprint_with_chair, seen)
    answer = solver.solve(request, CancelFlag())
    assert isinstance(answer.route, Path)
    return np.asarray(answer.route.poses[:, :2])


def passes(route: Array, node: int) -> bool:
    return bool(np.hypot(*(route - CORNER[node]).T).min() < 1.0)


@pytest.mark.parametrize("wall_m", [1.0, 3.0])
def test_lanes_that_meet_in_a_corner_are_not_excluded_with_the_blocked_one(wall_m: float) -> None:
    """Whatever room the wall behind the corner leaves to a chair that enters it ahead."""
    route = around_the_corner(wall_m, wall(23.0, 29.0, 13.0, 13.2))
    assert [passes(route, node) for node in (1, 2, 4, 5)] == [True] * 4


def test_a_lane_that_a_chair_cannot_turn_into_is_excluded_alone() -> None:
    """Walls on both sides of the lane west of (26, 10) leave room to a chair that need not turn."""
    beside = np.concatenate((wall(22.0, 25.3, 9.2, 9.4), wall(22.0, 25.3, 10.6, 10.8)))
    route = around_the_corner(1.0, beside, ahead_m=100.0)
    assert [passes(route, node) for node in (1, 2, 4)] == [True, True, False]


def test_a_lane_that_leaves_the_map_is_excluded() -> None:
    points = np.array([(15.0, 4.0), (15.0, 25.0), (26.0, 16.0), (26.0, 4.0)])
    edges = np.array([(0, 1), (1, 2), (0, 3), (3, 2)])
    graph = RouteGraph(points, edges, np.arange(4), np.array([1.0, 1.0, 90.0, 90.0]), np.full(4, np.inf), np.ones(4))
    route = solved(Pose2(15.0, 4.0, 0.0), Pose2(26.0, 15.0, 0.0), graph)
    assert np.hypot(*(route - points[3]).T).min() < 1.0


def test_a_route_leaves_the_lanes_if_the_graph_has_no_other() -> None:
    route = solved(WEST, EAST, graph_of(((0, 1), (1, 2))), wall(20.0, 20.5, 1.0, 7.0))
    assert route[-1].tolist() == [27.0, 10.0]
    assert at_x(route, 20.2) > 7.0


def test_an_entry_that_cannot_be_reached_is_not_used() -> None:
    """A closed wall between the start and the lane next to it."""
    cells = hall().occupancy.copy()
    cells[60, :250] = OCCUPIED
    solver = RouteSolver(params().planner, PlanningGrid(Grid(0.1, 0.0, 0.0, cells)), lanes_of(graph_of()))
    request = RouteRequest(Pose2(3.0, 7.5, 0.0), Pose2(24.0, 14.0, 0.0), ROBOT.footprint, np.empty((0, 2)))
    answer = solver.solve(request, CancelFlag())
    assert isinstance(answer.route, Path)
    assert answer.route.poses[:, 1].min() > 6.0


def test_the_robot_drives_on_the_lanes_at_their_speed() -> None:
    story, announced = Story(nothing, hall()), Departure(load(DepartureParams, "departure"), announced=True)
    story.controller = NavigationController(
        params(use_costmap=True), ROBOT, "map", announced, hall(), PromptRoutes, graph=graph_of(speeds={1: 0.4})
    )
    story.drive.pose = WEST
    assert story.go(EAST) == ""
    story.until(lambda _: story.drive.pose.x > 23.0, 120.0)
    way = np.array([(pose.x, pose.y) for pose in story.poses])
    speeds = np.array([output.twist.speed() for output in story.outputs])
    first, second = (way[:, 0] > 7.0) & (way[:, 0] < 13.0), (way[:, 0] > 17.0) & (way[:, 0] < 23.0)
    assert np.abs(way[first | second, 1] - 4.0).max() < 0.4
    assert speeds[first].max() > 0.6
    assert 0.3 < speeds[second].max() < 0.42

"""Routes planned beside the tick: the newest request wins, and an unreachable goal is reported once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from robot_stack.core.geometry import ZERO_TWIST, Pose2
from robot_stack.core.goals import GoalStatus
from robot_stack.core.site_map import FREE, OCCUPIED, Grid
from robot_stack.navigation.background_planner import BackgroundPlanner
from robot_stack.navigation.cancel_flag import CancelFlag
from robot_stack.navigation.controller import Output
from robot_stack.navigation.goal import GoalCode, GoalEnd
from robot_stack.navigation.grid_kernels import NO_GUIDE, Ground, Prices, astar
from robot_stack.navigation.one_way import FREE_COURSES
from robot_stack.navigation.planning_grid import PlanningGrid
from robot_stack.navigation.routes import PromptRoutes, RoutePlanner, RouteRequest, RouteResult, RouteSolver
from robot_stack.navigation.states import NavigationState
from tests.support.stepped_worker import SteppedWorker
from tests.unit.navigation.plant import ROBOT, params
from tests.unit.navigation.test_among_obstacles import Story, box, corridor, nothing, reached

START, GOAL = Pose2(2.0, 5.0, 0.0), Pose2(13.0, 5.0, 0.0)
NOTHING_SEEN = np.empty((0, 2))


def divided(gate: slice | None = None) -> Grid:
    """Returns the corridor with a wall across it at x = 8 m. gate: rows of an opening in the wall."""
    cells = corridor().occupancy.copy()
    cells[:, 80] = OCCUPIED
    if gate is not None:
        cells[gate, 80] = FREE
    return Grid(0.1, 0.0, 0.0, cells)


def ended(output: Output) -> bool:
    return output.end is not None


def question(goal: Pose2 = GOAL, seen: np.ndarray = NOTHING_SEEN) -> RouteRequest:
    return RouteRequest(START, goal, ROBOT.footprint, seen)


def solver(grid: Grid | None) -> RouteSolver:
    return RouteSolver(params().planner, None if grid is None else PlanningGrid(grid))


def test_what_is_seen_at_the_map_narrows_a_gate_unless_it_closes_it() -> None:
    """The gate is open from 4.4 to 5.6 m."""

    def passed_at_m(*seen_y_m: float) -> float:
        at_map = np.array([(8.05, y) for y in seen_y_m]).reshape(-1, 2)
        asked = RouteRequest(Pose2(6.8, 4.9, 0.0), GOAL, ROBOT.footprint, NOTHING_SEEN, at_map)
        route = solver(divided(slice(44, 56))).solve(asked, CancelFlag()).route
        assert route is not None
        return float(np.interp(8.05, route.poses[:, 0], route.poses[:, 1]))

    assert passed_at_m(4.45) == pytest.approx(5.05, abs=0.04)
    assert passed_at_m(4.85, 5.15) == passed_at_m()


@dataclass
class Noted:
    """Answers as ``PromptRoutes`` does, but returns an answer only after ``late`` more calls. Records the requests."""

    solver: RouteSolver
    late: int = 0
    questions: list[RouteRequest] = field(default_factory=list)
    _answer: RouteResult | None = None
    _asked_for: int = 0

    def ask(self, asked: RouteRequest) -> None:
        self.questions.append(asked)
        self._answer, self._asked_for = self.solver.solve(asked, CancelFlag()), 0

    def take(self) -> RouteResult | None:
        self._asked_for += 1
        if self._asked_for <= self.late:
            return None
        answer, self._answer = self._answer, None
        return answer

    def drop(self) -> None:
        self._answer = None


def story(grid: Grid, late: int = 0, paint: Callable[..., np.ndarray] = nothing) -> tuple[Story, Noted]:
    made: list[Noted] = []

    def routes(of: RouteSolver) -> RoutePlanner:
        made.append(Noted(of, late))
        return made[0]

    return Story(paint, grid, routes=routes), made[0]


def test_mapped_obstacles_are_lasting_and_seen_ones_are_not() -> None:
    assert solver(divided()).solve(question(), CancelFlag()) == RouteResult(
        None, "no path from (2.0, 5.0) to (13.0, 5.0)", lasting=True
    )
    across = np.column_stack((np.full(200, 8.05), np.linspace(0.0, 10.0, 200)))
    answer = solver(divided(slice(40, 60))).solve(question(seen=across), CancelFlag())
    assert (answer.route, answer.lasting) == (None, False)
    assert "no path" in answer.reason
    assert solver(divided(slice(40, 60))).solve(question(), CancelFlag()).route is not None
    ring = (GOAL.x, GOAL.y) + 2.0 * np.array([(np.cos(angle), np.sin(angle)) for angle in np.linspace(0.0, 6.29, 400)])
    without_map = solver(None).solve(question(seen=ring), CancelFlag())
    assert (without_map.route, without_map.lasting) == (None, False)


def test_two_solvers_of_one_map_do_not_see_each_other_s_obstacles() -> None:
    site = PlanningGrid(divided(slice(40, 60)))
    one, other = RouteSolver(params().planner, site), RouteSolver(params().planner, site)
    across = np.column_stack((np.full(200, 8.05), np.linspace(0.0, 10.0, 200)))
    assert one.solve(question(seen=across), CancelFlag()).route is None
    assert other.solve(question(), CancelFlag()).route is not None
    assert np.array_equal(site.field, site.known_field)


@given(st.integers(0, 2**32 - 1), st.sampled_from([0, 50, 10_000]), st.floats(0.2, 0.5))
@settings(max_examples=40, deadline=None)
def test_a_way_is_found_exactly_where_there_is_one(seed: int, flood_cells: int, share: float) -> None:
    """Cells that touch, also at a corner, are connected, as in the labels of scipy."""
    random = np.random.default_rng(seed)
    free = random.random((40, 50)) > share
    start, goal = ((int(random.integers(40)), int(random.integers(50))) for _ in range(2))
    free[start] = free[goal] = True
    labels, _ = ndimage.label(free, structure=np.ones((3, 3)))
    clear, unknown = free.astype(np.float32), np.zeros(free.shape, np.bool_)
    blocked = np.empty((0, 3), np.int64)
    ground, prices = Ground(clear, unknown, FREE_COURSES, NO_GUIDE), Prices(0.5, 0.5, 0.0, 1.0)
    found = astar(ground, prices, 1, start, goal, 0.0, 1.2, blocked, 0, flood_cells, np.zeros(1, np.bool_))
    assert bool(len(found)) == bool(labels[start] == labels[goal])
    if len(found):
        assert tuple(found[0]) == start
        assert tuple(found[-1]) == goal
        assert free[tuple(found.T)].all()


def big_divided() -> Grid:
    """Returns 300 m x 300 m in two halves, where a search covers a large area."""
    cells = np.full((3000, 3000), FREE, np.int8)
    cells[1490:1496, :] = OCCUPIED
    return Grid(0.1, 0.0, 0.0, cells)


BIG = RouteRequest(Pose2(150.0, 2.0, 1.5), Pose2(150.0, 298.0, 1.5), ROBOT.footprint, NOTHING_SEEN)
SMALL = RouteRequest(Pose2(10.0, 10.0, 0.0), Pose2(20.0, 10.0, 0.0), ROBOT.footprint, NOTHING_SEEN)


@pytest.fixture(scope="module")
def big() -> RouteSolver:
    return solver(big_divided())


@pytest.fixture
def worker() -> SteppedWorker:
    return SteppedWorker()


@pytest.fixture
def planner(big: RouteSolver, worker: SteppedWorker) -> BackgroundPlanner:
    return BackgroundPlanner(big, worker)


def test_the_newest_question_wins(planner: BackgroundPlanner, worker: SteppedWorker) -> None:
    planner.ask(BIG)
    planner.ask(SMALL)
    assert planner.busy()
    assert planner.take() is None
    worker.finish()
    assert not planner.busy()
    answer = planner.take()
    assert answer is not None
    assert answer.route is not None
    assert answer.route.end().distance_to(SMALL.goal) < 1e-9
    assert planner.take() is None
    planner.ask(SMALL)
    worker.start()
    assert planner.busy()
    assert planner.take() is None, "the answer comes with the node's loop"
    worker.deliver()
    planner.ask(BIG)
    assert planner.take() is None, "an answer that is not taken is dropped by the next question"


@pytest.mark.parametrize("running", [False, True])
def test_a_question_that_is_dropped_is_not_answered(
    planner: BackgroundPlanner, worker: SteppedWorker, running: bool
) -> None:
    planner.ask(SMALL)
    if running:
        worker.start()
    planner.drop()
    assert not planner.busy()
    worker.deliver() if running else worker.finish()
    assert planner.take() is None
    planner.ask(SMALL)
    worker.finish()
    assert planner.take() is not None


def test_a_search_that_is_stopped_ends_without_a_way(big: RouteSolver) -> None:
    stop = CancelFlag()
    stop.set()
    assert big.solve(BIG, stop).route is None


def test_an_error_in_a_plan_is_an_answer(planner: BackgroundPlanner, worker: SteppedWorker) -> None:
    planner.ask(RouteRequest(BIG.start, BIG.goal, ROBOT.footprint, np.empty(3)))
    worker.finish()
    answer = planner.take()
    assert answer is not None
    assert "planning failed: " in answer.reason


def test_the_end_stops_a_search_and_the_worker(big: RouteSolver, worker: SteppedWorker) -> None:
    asked: list[CancelFlag] = []

    class Solver:
        def solve(self, question: RouteRequest, stop: CancelFlag) -> RouteResult:
            asked.append(stop)
            ended.close(2.0)
            return RouteResult(None, "stopped")

    ended = BackgroundPlanner(cast("RouteSolver", Solver()), worker)
    ended.ask(BIG)
    worker.start()
    assert asked[0].is_set
    assert not ended.busy()
    assert worker.closed


def test_a_goal_behind_a_wall_of_the_map_is_refused_once_and_not_planned_again() -> None:
    driven, routes = story(divided(), late=3)
    assert driven.go(GOAL) == ""
    output = driven.until(ended, 0.5)
    text = "goal refused: no path from (2.0, 5.0) to (13.0, 5.0)"
    assert output.end == GoalEnd(GoalStatus.ABORTED, text, GoalCode.NO_VALID_PATH)
    assert output.text == text
    assert (output.state, output.twist) == (NavigationState.IDLE, ZERO_TWIST)
    assert driven.controller.goal is None
    assert driven.controller.path is None
    assert driven.tick().end is None
    for _ in range(5):  # as a mission manager repeats its goal
        assert driven.go(GOAL) == "no path from (2.0, 5.0) to (13.0, 5.0)"
        assert driven.tick().text == output.text
    assert len(routes.questions) == 1
    assert driven.go(Pose2(6.0, 5.0, 0.0)) == ""
    driven.until(reached)


def test_a_goal_that_turns_out_to_be_unreachable_stops_a_moving_robot_smoothly() -> None:
    driven, _ = story(divided(), late=4)
    driven.go(Pose2(6.5, 5.0, 0.0))
    driven.until(lambda output: output.twist.speed() > 0.8)
    driven.go(GOAL)
    driven.until(ended, 1.0)
    driven.until(lambda output: output.state is NavigationState.IDLE, 5.0)
    assert driven.drive.pose.x < 7.0
    speeds = [output.twist.speed() for output in driven.outputs[-60:]]
    assert max(before - after for before, after in pairwise(speeds)) < 0.12


def test_another_goal_while_a_route_is_planned_wins() -> None:
    driven, routes = story(divided(slice(70, 90)), late=5)
    driven.go(GOAL)
    driven.tick()
    assert driven.outputs[-1].text == "planning a route"
    driven.controller.stop()
    assert all(driven.tick().twist == ZERO_TWIST for _ in range(10))
    assert driven.controller.goal is None
    driven.go(GOAL)
    driven.tick()
    driven.go(Pose2(4.0, 5.0, 0.0))
    driven.until(reached)
    assert driven.drive.pose.distance_to(Pose2(4.0, 5.0, 0.0)) < 0.04
    assert max(pose.x for pose in driven.poses) < 4.5
    assert routes.questions[0].goal == GOAL


def test_a_robot_that_is_off_its_route_plans_again() -> None:
    driven, routes = story(corridor(), paint=box(6.5, 7.5, 4.3, 5.7))
    driven.go(GOAL)
    driven.until(lambda output: output.state is NavigationState.FOLLOWING and output.twist.speed() > 0.3)
    asked = len(routes.questions)
    driven.drive.pose = driven.drive.pose.compose(Pose2(0.0, -2.0, 0.0))
    driven.until(lambda _: len(routes.questions) > asked, 3.0)


def test_blocked_route_is_replanned_only_after_a_change() -> None:
    """A closed gate is planned for once, and once more after each change."""

    def shut(now_s: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        gate = (abs(x - 8.05) < 0.06) & (now_s < 17.0)
        return gate | ((np.hypot(x - 4.0, y - 8.0) < 0.3) & (now_s > 14.0))

    driven, routes = story(divided(slice(40, 60)), late=2, paint=shut)
    driven.go(GOAL)
    while driven.now_s < 13.9:
        driven.tick()
    asked = len(routes.questions)
    assert driven.outputs[-1].text.startswith("waiting: the only path is blocked")
    while driven.now_s < 16.9:
        driven.tick()
    assert len(routes.questions) == asked + 1
    driven.until(reached)


def test_prompt_planner_discards_dropped_requests() -> None:
    prompt = PromptRoutes(solver(divided(slice(40, 60))))
    prompt.ask(question())
    prompt.drop()
    assert prompt.take() is None
    prompt.ask(question())
    first = prompt.take()
    assert first is not None
    assert first.route is not None
    assert prompt.take() is None

"""The controller among obstacles, in fake time: a robot that follows its commands and a synthetic costmap."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest

from robot_stack.core.config import load
from robot_stack.core.departure import Departure, DepartureParams
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2
from robot_stack.core.goals import GoalStatus
from robot_stack.core.limits import NO_LIMIT, MotionLimits, SpeedLimit
from robot_stack.core.people import Person
from robot_stack.core.site_map import FREE, OCCUPIED, Grid
from robot_stack.core.zones import Zone
from robot_stack.navigation.controller import NavigationController, Output, Situation
from robot_stack.navigation.footprint import outline
from robot_stack.navigation.goal import GoalCode, GoalEnd
from robot_stack.navigation.local_map import LocalMap, local_map
from robot_stack.navigation.planning_grid import PlanningGrid
from robot_stack.navigation.pose_source import Located
from robot_stack.navigation.rollout_controller import RolloutController
from robot_stack.navigation.rollout_kernels import along_poses, free_time
from robot_stack.navigation.routes import PromptRoutes, RoutePlanner, RouteSolver
from robot_stack.navigation.states import NavigationState
from robot_stack.navigation.velocity_smoother import VelocitySmoother
from robot_stack.navigation.world_model import WorldModel
from robot_stack.navigation.yielding import nearest_m
from tests.support.sweeps import Sweeps
from tests.unit.navigation.plant import ROBOT, Drive, params, request

_N, _RES = 200, 0.05
Array = npt.NDArray[np.float64]
Painter = Callable[[float, npt.NDArray[np.float64], npt.NDArray[np.float64]], npt.NDArray[np.bool_]]


class Story:
    """paint(time, x, y) returns which points of the ground are obstacles."""

    def __init__(
        self,
        paint: Painter,
        grid: Grid | None = None,
        *,
        chair: bool = False,
        routes: Callable[[RouteSolver], RoutePlanner] = PromptRoutes,
        zones: tuple[Zone, ...] = (),
        seeing: bool = True,
    ) -> None:
        announced = Departure(load(DepartureParams, "departure"), announced=True)
        self.controller = NavigationController(params(use_costmap=seeing), ROBOT, "map", announced, grid, routes, zones)
        self.controller.set_passenger(chair)
        self.drive = Drive(ROBOT.motion(chair), pose=Pose2(2.0, 5.0, 0.0))
        self.footprint = ROBOT.footprint_with_chair if chair else ROBOT.footprint
        self.paint = paint
        self.now_s = 10.0
        self.seeing = self.watching = seeing
        self.outputs: list[Output] = []
        self.clearances: list[float] = []
        self.poses: list[Pose2] = []
        self.sweeps = Sweeps(ROBOT, np.random.default_rng(1))
        self._ticks = 0

    def sweep(self) -> None:
        lethal, x0, y0 = self._painted()
        self.sweeps.sweep(self.now_s, self.drive.pose, lethal, _RES, x0, y0)

    def _painted(self) -> tuple[npt.NDArray[np.bool_], float, float]:
        """Lethal cells around the robot, and their corner."""
        x0, y0 = round(self.drive.pose.x / _RES) * _RES - 5.0, round(self.drive.pose.y / _RES) * _RES - 5.0
        axis = (np.arange(_N) + 0.5) * _RES
        x, y = np.meshgrid(x0 + axis, y0 + axis)
        return self.paint(self.now_s, x, y), x0, y0

    def look(self) -> None:
        lethal, x0, y0 = self._painted()
        cells = np.where(lethal, 100, 0).astype(np.int8)
        if self.watching:
            self.controller.around.on_people(self.now_s, self.sweeps.people(self.now_s), self.now_s)
        assert self.controller.around.on_costmap(self.now_s, _RES, Pose2(x0, y0, 0.0), cells, self.now_s) == ""
        here = np.array([(self.drive.pose.x, self.drive.pose.y, self.drive.pose.yaw)])
        field = self.controller.around.local
        assert field is not None
        self.clearances.append(float(along_poses(field.field, _RES, x0, y0, outline(self.footprint), here)[0]))

    def go(self, goal: Pose2) -> str:
        if self.seeing:
            self.look()
        return self.controller.request(request(goal), self.now_s, self.located())

    def located(self) -> Located:
        return Located(self.drive.pose, self.drive.twist, IDENTITY)

    def tick(self) -> Output:
        if self.seeing and self._ticks % 2 == 0:
            self.sweep()
        if self.seeing and self._ticks % 4 == 0:
            self.look()
        self._ticks += 1
        blind = self.controller.around.problem(self.now_s)
        output = self.controller.tick(Situation(self.now_s, self.located(), blind=blind))
        self.outputs.append(output)
        for _ in range(5):
            self.drive.step(output.twist)
            self.now_s += 0.01
        self.poses.append(self.drive.pose)
        return output

    def until(self, done: Callable[[Output], bool], limit_s: float = 90.0) -> Output:
        for _ in range(round(limit_s / 0.05)):
            output = self.tick()
            if done(output):
                return output
        raise AssertionError(f"not in {limit_s} s: {self.outputs[-1]}, {self.drive.pose}")


def nothing(_: float, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    return np.zeros(x.shape, np.bool_)


def box(x0: float, x1: float, y0: float, y1: float) -> Painter:
    return lambda _, x, y: (x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)


def kerbs() -> Grid:
    """An area of 16 x 16 m with an angled kerb, which ends in its middle."""
    cells = np.full((160, 160), FREE, np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = OCCUPIED
    cells[0:80, 60:62] = cells[80:82, 60:120] = cells[20:22, 60:140] = OCCUPIED
    return Grid(0.1, 0.0, 0.0, cells)


def reached(output: Output) -> bool:
    return output.reached


def corridor() -> Grid:
    """Returns a closed area of 16 x 10 m."""
    cells = np.full((100, 160), FREE, np.int8)
    cells[[0, -1], :] = OCCUPIED
    cells[:, [0, -1]] = OCCUPIED
    return Grid(0.1, 0.0, 0.0, cells)


@pytest.mark.parametrize("chair", [False, True])
def test_drives_around_unmapped_box(chair: bool) -> None:
    story = Story(box(6.5, 7.5, 4.3, 5.7), corridor(), chair=chair)
    assert story.go(Pose2(12.0, 5.0, 0.0)) == ""
    assert story.controller.path is not None
    assert story.controller.path.end().distance_to(Pose2(12.0, 5.0, 0.0)) < 1e-6
    story.until(reached)
    assert story.drive.pose.distance_to(Pose2(12.0, 5.0, 0.0)) < 0.04
    assert min(story.clearances) > 0.15
    motion = ROBOT.motion(chair)
    twists = [output.twist for output in story.outputs if output.state is NavigationState.FOLLOWING]
    assert max(twist.speed() for twist in twists) <= motion.max_speed_mps
    for before, after in pairwise(twists):
        change = math.hypot(after.vx - before.vx, after.vy - before.vy)
        assert change <= motion.max_acceleration_mps2 * 0.05 + 0.02


def test_beside_obstacles_the_robot_slows_down_to_the_limit_of_its_way_on_a_ramp() -> None:
    story = Story(box(6.5, 7.5, 4.3, 5.7), corridor())
    story.go(Pose2(12.0, 5.0, 0.0))
    story.until(lambda output: output.state is NavigationState.FOLLOWING and output.twist.speed() > 0.5)
    before = len(story.outputs)
    story.controller.set_way_limit(SpeedLimit(0.3, 0.5))
    story.until(reached)
    speeds = [output.twist.speed() for output in story.outputs[before - 1 :]]
    assert max(a - b for a, b in pairwise(speeds)) <= ROBOT.empty.max_acceleration_mps2 * 0.05
    assert 0.2 < max(speeds[20:]) <= 0.3


def test_without_a_map_the_costmap_is_enough() -> None:
    story = Story(box(6.5, 7.5, 4.3, 5.7))
    story.go(Pose2(12.0, 5.0, 0.0))
    story.until(reached)
    assert min(story.clearances) > 0.2


def test_narrow_gate_is_passed_slowly_in_its_middle() -> None:
    def gate(_: float, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        return (abs(x - 7.5) < 0.1) & (abs(y - 5.0) > 0.65)

    story = Story(gate)
    story.go(Pose2(12.0, 5.3, 0.0))
    story.until(reached)
    inside = [(p, o) for p, o in zip(story.poses, story.outputs, strict=True) if abs(p.x - 7.5) < 0.3]
    assert inside
    assert max(abs(pose.y - 5.0) for pose, _ in inside) < 0.1
    assert max(output.twist.speed() for _, output in inside) < 0.5
    assert min(story.clearances) > 0.1


def two_gates() -> Grid:
    """The area with a wall across: a gate in the middle, and one at the left."""
    cells = corridor().occupancy.copy()
    cells[:, 80] = OCCUPIED
    cells[43:57, 80] = cells[70:90, 80] = FREE
    return Grid(0.1, 0.0, 0.0, cells)


def closing(at_s: float, *, left_open: bool) -> Painter:
    """The wall as it is seen: its middle gate closes."""

    def paint(now_s: float, x: Array, y: Array) -> npt.NDArray[np.bool_]:
        free = (abs(y - 5.0) < 0.7) & (now_s < at_s) | ((y > 7.0) & (y < 9.0) & left_open)
        return (abs(x - 8.05) < 0.06) & ~free

    return paint


def test_blocked_path_is_replanned() -> None:
    story = Story(closing(13.0, left_open=True), two_gates())
    story.go(Pose2(13.0, 5.0, 0.0))
    story.until(reached)
    crossing = min(story.poses, key=lambda pose: abs(pose.x - 8.05))
    assert crossing.y > 7.3
    assert min(story.clearances) > 0.1


@pytest.mark.parametrize(("goal", "again"), [(Pose2(13.0, 5.0, 0.0), True), (Pose2(13.0, 5.3, 0.0), False)])
def test_only_way_blocked_waits_then_gives_up_with_the_reason(goal: Pose2, again: bool) -> None:
    """The waiting counts across a withdrawal of the same goal, as by the mission manager for its departure warning."""
    story = Story(closing(12.0, left_open=False), two_gates())
    story.go(Pose2(13.0, 5.0, 0.0))
    story.until(lambda output: output.text.startswith("waiting: the only path is blocked at (7"), 30.0)
    begun_s = story.now_s
    for _ in range(round(8.0 / 0.05)):
        story.tick()
    story.controller.cancel()
    for _ in range(round(2.0 / 0.05)):
        story.tick()
    story.go(goal)
    output = story.until(lambda output: "gave up" in output.text, 30.0)
    give_up_s = params(use_costmap=True).follow.give_up_s
    waited_s = story.now_s - begun_s - 2.0
    assert waited_s == pytest.approx(give_up_s if again else 8.0 + give_up_s, abs=1.5)
    assert output.end == GoalEnd(GoalStatus.ABORTED, output.text, GoalCode.PATIENCE_EXCEEDED)
    assert "the only path is blocked" in output.text
    output = story.until(lambda output: output.state is NavigationState.IDLE, 10.0)
    assert (story.controller.path, story.controller.goal, output.twist) == (None, None, ZERO_TWIST)
    assert min(story.clearances) > 0.15


def test_goal_of_a_robot_that_is_held_beside_a_route_ends() -> None:
    story = Story(box(8.0, 8.6, 4.5, 5.5), corridor())
    story.go(Pose2(14.0, 5.0, 0.0))
    story.until(lambda output: output.state is NavigationState.FOLLOWING and story.drive.twist.speed() > 0.5)
    story.drive.blocked = True
    output = story.until(lambda output: output.end is not None, 30.0)
    assert output.end is not None
    assert output.end.code is GoalCode.FAILED_TO_MAKE_PROGRESS
    story.until(lambda output: output.state is NavigationState.IDLE, 3.0)


def test_short_stops_do_not_extend_the_wait_for_a_closed_path() -> None:
    story = Story(closing(12.0, left_open=False), two_gates())
    story.go(Pose2(13.0, 5.0, 0.0))
    story.until(lambda output: output.text.startswith("waiting: the only path is blocked"), 30.0)
    for _ in range(4):
        for limit in (SpeedLimit(0.0, 0.0), NO_LIMIT):
            story.controller.set_speed_limit(limit)
            for _ in range(4):
                story.tick()
        for _ in range(round(5.0 / 0.05)):
            story.tick()
    assert any(output.end is not None and "gave up" in output.text for output in story.outputs)


def test_robot_keeps_clear_of_pedestrian_stopping_in_front() -> None:
    def person_x(now_s: float) -> float:
        return max(12.5 - 1.2 * (now_s - 10.0), 8.0)

    story = Story(lambda now_s, x, y: np.hypot(x - person_x(now_s), y - 5.0) < 0.25, chair=True)
    assert story.go(Pose2(12.0, 5.0, 0.0)) == ""
    gaps_m = []
    for _ in range(200):
        story.tick()
        if story.drive.twist.speed() > 0.02:
            at = np.array([(person_x(story.now_s), 5.0, 0.0, 0.0, 0.25, 0.2)])
            gaps_m.append(nearest_m(story.drive.pose, story.footprint, at))
    assert min(gaps_m) > 0.15


def test_robot_yields_to_crossing_pedestrian() -> None:
    def person(now_s: float, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        return np.hypot(x - 8.0, y - (1.0 + 0.8 * (now_s - 10.0))) < 0.25

    story = Story(person)
    story.go(Pose2(13.0, 5.0, 0.0))
    story.until(reached)
    met = min(pose.distance_to(Pose2(8.0, 1.0 + 0.8 * (0.05 * (i + 1)), 0.0)) for i, pose in enumerate(story.poses))
    assert met > 0.95  # 0.61 m is the robot's corner, 0.25 m the person's radius
    assert max(abs(pose.y - 5.0) for pose in story.poses) < 1.0  # no evasive motion


PERSON = np.array([2.0, 0.0, 0.0, 0.0, 0.25, 0.35])
BOX, OUTLINE = np.array([0.5, -0.5, 0.35, 0.0]), outline(ROBOT.footprint)
NOTHING = np.full((10, 10), 10.0, np.float32), 1.0, -5.0, -5.0, OUTLINE


@pytest.mark.parametrize(
    ("twist", "person", "free_s"),
    [
        ((0.5, 0.0, 0.0), PERSON, 1.7),  # 1.25 m gap: 0.35 is reached after 1.8 s
        ((0.0, 0.5, 0.0), PERSON, 3.0),  # past the person
        ((-0.5, 0.0, 0.0), PERSON, 3.0),  # away from the person
        ((0.0, 0.0, 0.0), np.array([2.0, 0.0, -1.0, 0.0, 0.25, 0.35]), 3.0),  # approaches: not the robot's motion
        ((0.5, 0.0, 0.0), np.array([0.9, 0.0, 0.0, 0.0, 0.25, 0.35]), 0.0),  # already too near, and approaching
        ((-0.5, 0.0, 0.0), np.array([0.9, 0.0, 0.0, 0.0, 0.25, 0.35]), 3.0),  # already too near, and moving away
    ],
)
def test_free_time_of_people(twist: tuple[float, float, float], person: Array, free_s: float) -> None:
    free = free_time(*NOTHING, np.zeros(3), np.array(twist), 0.2, 3.0, BOX, person[None])
    assert free == pytest.approx(free_s, abs=0.11)


def test_robot_drives_past_a_walking_person_beside_the_route() -> None:
    """0.3 m/s, as near people: a cost per time would be higher than that of standing still."""
    metres = np.arange(0.0, 7.0, 0.1)
    route = np.column_stack((metres, np.zeros((len(metres), 2)), metres, np.full(len(metres), 0.3)))
    walker = np.array([(1.0, 1.15, 0.3, 0.0, 0.25, 0.35)])
    field = np.full((200, 200), 10.0, np.float32)
    local = LocalMap(0.0, 0.1, -10.0, -10.0, np.zeros((200, 200), np.int8), np.zeros((200, 200), np.bool_), field)
    controller = RolloutController(params().local)
    limits = MotionLimits.of(ROBOT.motion(False))
    choice = controller.step(Pose2(0.0, 0.0, 0.0), Twist2(0.0, 0.0, 0.0), route, limits, ROBOT.footprint, local, walker)
    assert choice.twist.vx > 0.04


@pytest.mark.parametrize("seeing", [False, True])
def test_obstacles_that_only_the_map_has_are_avoided_beside_the_route(seeing: bool) -> None:
    grid, start, goal = kerbs(), Pose2(4.5, 12.0, -0.5 * math.pi), Pose2(14.0, 5.0, -0.5 * math.pi)
    story = Story(nothing, grid, seeing=seeing)
    story.drive.pose = start
    assert story.go(goal) == ""
    story.until(reached)
    poses = np.array([(pose.x, pose.y, pose.yaw) for pose in story.poses])
    clear_m = PlanningGrid(grid).clearance_m(outline(story.footprint), poses)
    assert clear_m.min() > 0.15


def test_obstacles_of_the_map_near_seen_ones_are_not_doubled() -> None:
    """The pose is 0.2 m off, and the right half of a mapped wall is not seen."""
    cells = np.zeros((100, 160), np.int8)
    cells[50, :] = OCCUPIED
    around = WorldModel(params(use_costmap=True), Grid(0.1, 0.0, 0.0, cells))
    seen = np.zeros((200, 200), np.int8)
    seen[105, :100] = 100
    around.on_costmap(1.0, _RES, Pose2(3.0, 0.0, 0.0), seen, 1.0)
    assert around.local is not None
    in_map = around.local.field[100:102] == 0.0
    assert not in_map[:, :100].any()
    assert in_map[:, 107:].all()
    assert len(around.local.points()) == 100, "only what is seen is remembered"


@pytest.mark.parametrize(
    ("corrected", "kept"),
    [
        (Pose2(0.1, 0.05, 0.005), True),  # the drift of an odometry
        (Pose2(0.0, 0.2, 0.0), False),
        (Pose2(0.32, -0.24, 0.04), False),  # turned about the robot
    ],
)
def test_a_correction_of_the_pose_ends_the_memory_of_obstacles(corrected: Pose2, kept: bool) -> None:
    story = Story(box(8.5, 9.0, 7.5, 8.0), corridor())
    story.drive.pose, around = Pose2(6.0, 8.0, 0.0), story.controller.around
    story.look()
    shown = around.shown()
    pose = corrected.compose(story.drive.pose)
    story.controller.tick(Situation(story.now_s, Located(pose, ZERO_TWIST, corrected)))
    assert (len(around.question(pose, pose, story.footprint).seen) > 0) is kept
    assert (around.shown() == shown) is kept


def test_an_object_at_the_edge_leaves_the_margin_to_other_obstacles() -> None:
    axis = (np.arange(_N) + 0.5) * _RES - 5.0
    x, y = np.meshgrid(axis, axis)
    object_at_edge, wall = np.hypot(x - 0.2, y - 0.35) < 0.04, abs(x - 1.0) < 0.06
    controller, no_people = RolloutController(params().local), np.empty((0, 6))
    for lethal, most_mps in ((object_at_edge, 0.4), (object_at_edge | wall, 0.2)):
        cells = np.where(lethal, np.int8(100), np.int8(0))
        local = local_map(1.0, _RES, Pose2(-5.0, -5.0, 0.0), cells, np.zeros_like(cells, np.bool_))
        assert float(local.clearance_m(OUTLINE, np.zeros((1, 3)))[0]) == 0.0
        twist, clear = controller.governed(IDENTITY, Twist2(0.4, 0.0, 0.0), ROBOT.footprint, local, no_people, 0.2)
        assert clear
        assert twist.vx <= most_mps + 1e-9
        assert twist.vx > 0.0


def test_slow_near_a_standing_person() -> None:
    story = Story(lambda _, x, y: np.hypot(x - 7.0, y - 6.1) < 0.25)
    story.go(Pose2(12.0, 5.0, 0.0))
    story.until(lambda _: story.drive.pose.x > 7.3)
    beside = [o.twist.speed() for p, o in zip(story.poses, story.outputs, strict=True) if abs(p.x - 7.0) < 0.3]
    assert max(beside) < 0.4


@pytest.mark.parametrize(("sense", "topic"), [("seeing", "/local_costmap/costmap"), ("watching", "/perception/people")])
def test_a_stale_sense_stops_at_once_and_a_fresh_one_resumes(sense: str, topic: str) -> None:
    story = Story(box(6.5, 7.5, 4.3, 5.7), corridor())
    story.go(Pose2(12.0, 5.0, 0.0))
    story.until(lambda output: output.twist.speed() > 0.3)
    setattr(story, sense, False)
    output = story.until(lambda output: output.state is NavigationState.HELD, 1.3)
    assert (output.twist, output.text) == (ZERO_TWIST, f"{topic} silent for more than 1.0 s")
    setattr(story, sense, True)
    story.until(lambda output: output.twist.speed() > 0.3)


def test_a_repeated_list_of_people_is_not_fresh() -> None:
    around = Story(nothing).controller.around
    around.on_costmap(1.0, _RES, IDENTITY, np.zeros((4, 4), np.int8), 3.0)
    for received_s in (1.0, 3.0):
        around.on_people(1.0, (), received_s)
    assert around.problem(3.0) == "/perception/people silent for more than 1.0 s"


def test_people_at_obstacles_of_the_map_are_left_out() -> None:
    around = Story(nothing, corridor()).controller.around
    wall, free, beyond = (Person(1.0, 5.0, y, walks=True, walked=True, apart_s=1.0) for y in (0.1, 5.0, -3.0))
    around.on_people(1.0, (wall, free, beyond), 1.0)
    assert around.people == (free, beyond), "outside the map there is no obstacle of it"


def test_cells_of_a_walker_are_no_static_obstacle_where_the_walker_is_at_the_costmap_s_stamp() -> None:
    story = Story(nothing)
    around, cells = story.controller.around, np.zeros((200, 200), np.int8)
    cells[98:103, 62:67] = 100  # the walker, 0.2 s after its detection
    cells[98:103, 100:105] = 100
    box = (2.9, 4.9, 3.15, 5.15)
    walker = Person(1.0, 3.0, 5.0, 1.0, 0.0, 0.25, box, walks=True, walked=True, apart_s=1.0)
    around.on_people(1.0, (walker,), 1.0)
    around.on_costmap(1.2, _RES, IDENTITY, cells, 1.2)
    assert around.local is not None
    assert set(np.floor(around.local.points()[:, 0] / _RES).astype(int)) == set(range(100, 105))


@pytest.mark.parametrize(
    ("resolution_m", "origin", "reason"),
    [
        (math.nan, IDENTITY, "info.resolution is nan"),
        (0.0, IDENTITY, "info.resolution is 0.0"),
        (0.05, Pose2(math.nan, 0.0, 0.0), "info.origin is not finite"),
        (0.05, Pose2(0.0, 0.0, 0.5), "info.origin is turned"),
    ],
)
def test_costmaps_that_cannot_be_used_are_named(resolution_m: float, origin: Pose2, reason: str) -> None:
    story = Story(nothing)
    cells = np.zeros((4, 4), np.int8)
    assert reason in story.controller.around.on_costmap(1.0, resolution_m, origin, cells, 1.0)
    assert story.controller.around.problem(1.0) != ""


def test_goals_in_the_wall_are_refused_and_the_robot_stands() -> None:
    story = Story(nothing, corridor())
    assert "an obstacle of the map" in story.go(Pose2(15.9, 5.0, 0.0))
    assert "outside the map" in story.go(Pose2(40.0, 5.0, 0.0))
    assert "must be within" in story.controller.request(request(Pose2(1e308, 5.0, 0.0)), story.now_s, None)
    assert story.tick().twist == ZERO_TWIST
    unseen = Story(nothing)
    unseen.seeing = False
    unseen.controller.request(request(Pose2(8.0, 5.0, 0.0)), unseen.now_s, unseen.located())
    assert all(unseen.tick().twist == ZERO_TWIST for _ in range(40))
    assert unseen.outputs[-1].text == "/local_costmap/costmap never received"


def test_ramp_treats_non_finite_values_as_zero() -> None:
    limits = MotionLimits(1.0, 1.0, 0.7, 0.7, 1.4, 1.4)
    ramp = VelocitySmoother()
    ramp.reset(Twist2(0.5, 0.0, 0.0))
    twist = ramp.towards(Twist2(math.nan, 0.0, 0.0), ramp.twist, limits, 0.05)
    assert twist.is_finite()
    assert twist.vx < 0.5

"""Narrow places: entered in line from any pose, driven as planned, and not occupied by a robot that waits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.core.geometry import Pose2, exp_se2
from robot_stack.core.limits import MotionLimits
from robot_stack.core.people import Person
from robot_stack.core.site_map import OCCUPIED, Grid
from robot_stack.navigation.footprint import outline
from robot_stack.navigation.goal import GoalCode
from robot_stack.navigation.path import Path
from robot_stack.navigation.planning_grid import PlanningGrid
from robot_stack.navigation.pose_follower import PoseFollower
from robot_stack.navigation.speed_limits import outside, speed_limits
from robot_stack.navigation.yielding import nearest_m
from tests.unit.navigation.plant import ROBOT, params
from tests.unit.navigation.test_among_obstacles import Array, Story, corridor, reached

P = params()
CHAIR = ROBOT.footprint_with_chair
GATE_X, GATE_Y, GATE_M = 8.05, 5.0, 1.3


def gate() -> Grid:
    """Returns a closed area of 16 x 10 m with a wall across and a gate of 1.3 m in it."""
    cells = corridor().occupancy.copy()
    half = round(GATE_M / 0.2)
    cells[: 50 - half, 80] = cells[50 + half :, 80] = OCCUPIED
    return Grid(0.1, 0.0, 0.0, cells)


def paint_gate(_: float, x: Array, y: Array) -> np.ndarray:
    return (abs(x - GATE_X) < 0.06) & (abs(y - GATE_Y) > GATE_M / 2)


def askew(count: int) -> list[Pose2]:
    """Returns poses at the gate with 0.08 to 0.25 m of clearance, in most of which the chair's front is in it."""
    random, field, found = np.random.default_rng(25), PlanningGrid(gate()), []
    while len(found) < count:
        x, y, yaw = random.uniform((5.8, 4.3, -0.9), (7.6, 5.7, 0.9))
        clear_m = float(field.clearance_m(outline(CHAIR), np.array([(x, y, yaw)]))[0]) - field.half_cell_m
        if 0.08 < clear_m < 0.25:
            found.append(Pose2(float(x), float(y), float(yaw)))
    return found


@pytest.mark.parametrize("start", askew(3))
def test_a_robot_pushed_askew_into_a_gate_backs_off_turns_and_enters(start: Pose2) -> None:
    story = Story(paint_gate, gate(), chair=True)
    story.drive.pose = start
    assert story.go(Pose2(13.0, 5.0, 0.0)) == ""
    story.until(reached, 60.0)
    assert min(story.clearances) > 0.05
    inside = [pose for pose in story.poses if abs(pose.x - GATE_X) < 0.4]
    assert max(abs(pose.yaw) for pose in inside) < 0.5


LIMITS = MotionLimits.of(ROBOT.motion(True))


def follow(path: Path, start: Pose2, clear_m: float = 0.2) -> list[Pose2]:
    """Returns the poses of an ideal robot that obeys for 20 s."""
    follower, pose, driven = PoseFollower(path, P.passage, P.tracking), start, [start]
    for _ in range(400):
        assert follower.locate(pose)
        ahead = follower.ahead(P.passage.ahead_m)
        clear = np.where(ahead[:, 0] < 2.5, clear_m, 0.0)
        twist = follower.command(pose, ahead, clear, 1.0, LIMITS)
        assert twist.speed() <= P.passage.speed_mps + 0.1
        pose = pose.compose(exp_se2(twist, 0.05))
        driven.append(pose)
    return driven


def test_turn_on_the_spot_is_driven_before_the_way_goes_on() -> None:
    path = Path(np.array([(0.0, 0.0, 1.2), *((0.0, 0.0, yaw) for yaw in np.arange(1.1, -0.05, -0.1)), (2.0, 0.0, 0.0)]))
    driven = follow(path, Pose2(0.02, -0.03, 1.15))
    assert driven[-1].distance_to(Pose2(2.0, 0.0, 0.0)) < 0.03
    assert all(pose.x < 0.2 for pose in driven if abs(pose.yaw) > 0.25)
    assert max(abs(pose.y) for pose in driven) < 0.05


def test_way_back_over_the_same_place_is_not_skipped() -> None:
    back = [(-0.1 * i, 0.0, 0.3) for i in range(11)]
    turn = [(-1.0, 0.0, 0.2), (-1.0, 0.0, 0.1)]
    path = Path(np.array([*back, *turn, *((-1.0 + 0.1 * i, 0.0, 0.0) for i in range(31))]))
    driven = follow(path, Pose2(0.0, 0.0, 0.3))
    assert min(pose.x for pose in driven) < -0.9
    assert driven[-1].distance_to(Pose2(2.0, 0.0, 0.0)) < 0.03


def test_a_robot_nearer_than_the_margin_leaves_and_comes_no_nearer() -> None:
    path, here = Path(np.array([(0.1 * i, 0.0, 0.0) for i in range(41)])), Pose2(0.0, 0.0, 0.0)
    follower = PoseFollower(path, P.passage, P.tracking)
    assert follower.locate(here)
    ahead = follower.ahead(P.passage.ahead_m)
    falling = 0.10 - 0.03 * ahead[:, 0]
    assert follower.command(here, ahead, np.full(len(ahead), 0.10), 1.0, LIMITS).vx > 0.2
    assert follower.command(here, ahead, falling, 1.0, LIMITS).vx == pytest.approx(0.0, abs=1e-9)


def test_off_the_route_its_poses_are_not_followed() -> None:
    follower = PoseFollower(Path(np.array([(0.0, 0.0, 0.0), (3.0, 0.0, 0.0)])), P.passage, P.tracking)
    assert follower.locate(Pose2(1.0, 0.1, 0.1))
    path = Path(np.array([(0.1 * i, 0.0, 0.0) for i in range(41)]))
    assert 2.2 < follow(path, Pose2(0.0, 0.0, 0.0))[-1].x < 2.5, "it stops before the first pose that is not clear"
    assert not follower.locate(Pose2(1.0, 0.3, 0.0))
    assert not follower.locate(Pose2(1.0, 0.0, 0.5))
    assert follower.locate(Pose2(2.5, 0.0, 0.0))


ALONG = np.arange(0.0, 7.0, 0.1)


def narrow_between(from_m: float, to_m: float) -> Array:
    return np.where((from_m - 1e-9 <= ALONG) & (to_m + 1e-9 >= ALONG), 0.2, 1.0)


@pytest.mark.parametrize(
    ("stop_m", "narrow", "person_m", "waits_m"),
    [
        (2.5, (2.0, 4.0), 4.0, 2.0 - P.passage.wait_m),  # in the passage
        (4.5, (2.0, 4.0), 4.0, 2.0 - P.passage.wait_m),  # behind it, with the rear in its way
        (2.5, (2.0, 4.0), 9.0, 2.5),  # the robot is nearer to it
        (6.0, (2.0, 4.0), 4.0, 6.0),  # behind it, with room for the other
        (0.5, (2.0, 4.0), 4.0, 0.5),  # before it
        (2.5, (0.0, 4.0), 4.0, 2.5),  # the robot is in the passage
        (6.0, (9.0, 9.0), 4.0, 6.0),  # no narrow place
    ],
)
def test_who_is_in_a_passage_or_nearer_has_it(
    stop_m: float, narrow: tuple[float, float], person_m: float, waits_m: float
) -> None:
    route = np.column_stack((ALONG, np.zeros((len(ALONG), 2)), ALONG))
    stops_m = outside(stop_m, route, narrow_between(*narrow), (person_m, 0.0), CHAIR, P.passage)
    assert stops_m == pytest.approx(waits_m)


def test_speed_near_people_counts_from_the_chair_s_front() -> None:
    route = np.column_stack((ALONG, np.zeros((len(ALONG), 2)), ALONG))
    far, unlimited = np.full(len(ALONG), 2.0), np.full(len(ALONG), np.inf)

    def speed_mps(x: float) -> float:
        person = Person(0.0, x, 0.0, radius_m=0.3)
        near = (LIMITS, CHAIR, P.speed_limits, P.people, P.passage, True)
        return float(speed_limits(route, far, unlimited, (person,), 0.0, 0.5, *near).speed_mps[0])

    assert speed_mps(CHAIR.front_m + 0.3 + P.people.very_near_m - 0.01) == pytest.approx(P.people.very_near_mps)
    assert P.people.very_near_mps < speed_mps(CHAIR.front_m + 0.3 + 1.0) < P.people.near_mps
    assert speed_mps(CHAIR.rear_m - 0.3 - 0.1) == LIMITS.speed_mps, "the robot drives away"


def test_people_who_come_along_the_way_stop_the_robot_only_before_narrow_places() -> None:
    route = np.column_stack((ALONG, np.zeros((len(ALONG), 2)), ALONG))
    person = Person(0.0, 5.5, 0.0, -0.3, 0.05, radius_m=0.25, walks=True, walked=True)
    unlimited = np.full(len(ALONG), np.inf)
    near = (LIMITS, CHAIR, P.speed_limits, P.people, P.passage, True)
    for narrow, yields in (((9.0, 9.0), False), ((0.5, 6.0), True)):
        cap = speed_limits(route, narrow_between(*narrow), unlimited, (person,), 0.0, 0.6, *near)
        assert cap.yields == yields, narrow


@pytest.mark.parametrize(
    ("crosses_m", "comes_s", "lets_pass", "narrow", "yields"),
    [
        (3.0, 2.0, True, (9.0, 9.0), True),
        (3.0, 2.0, False, (9.0, 9.0), False),  # people were let pass for long enough
        (5.0, 2.5, False, (1.0, 6.0), True),  # the robot would stand in a narrow place
    ],
)
def test_people_are_let_pass_for_some_time_but_always_through_narrow_places(
    crosses_m: float, comes_s: float, lets_pass: bool, narrow: tuple[float, float], yields: bool
) -> None:
    route = np.column_stack((ALONG, np.zeros((len(ALONG), 2)), ALONG))
    person = Person(0.0, crosses_m, -comes_s, vy=1.0, radius_m=0.25, walks=True, walked=True)
    clear, unlimited = narrow_between(*narrow), np.full(len(ALONG), np.inf)
    near = (LIMITS, CHAIR, P.speed_limits, P.people, P.passage, lets_pass)
    cap = speed_limits(route, clear, unlimited, (person,), 0.0, 0.6, *near)
    assert cap.yields == yields
    assert (cap.speed_mps.min() == 0.0) == yields


@pytest.mark.parametrize(
    ("to", "start", "passes"),
    [
        ((10.2, 4.6), Pose2(3.0, 4.5, 0.3), True),  # behind the gate: driven around
        ((8.1, 5.0), Pose2(3.0, 4.5, 0.3), False),  # in the gate: waited for, then the robot says that it cannot pass
    ],
)
def test_person_who_comes_to_the_gate_and_stands(to: tuple[float, float], start: Pose2, passes: bool) -> None:
    def paint(now_s: float, x: Array, y: Array) -> np.ndarray:
        share = min(1.0, (now_s - 10.0) / 5.0)
        px, py = (a + share * (b - a) for a, b in zip((12.5, 3.0), to, strict=True))
        return paint_gate(now_s, x, y) | (np.hypot(x - px, y - py) < 0.25)

    story = Story(paint, gate(), chair=True)
    story.drive.pose = start
    assert story.go(Pose2(13.0, 6.5, 0.0)) == ""
    end = story.until(lambda output: output.end is not None, 90.0 if passes else 60.0).end
    assert end is not None
    assert min(story.clearances[30:]) > 0.05, "nobody is touched"
    assert end.succeeded is passes, end.text
    if not passes:
        assert end.code is GoalCode.PATIENCE_EXCEEDED
        assert "blocked" in end.text or "no progress" in end.text
        assert story.drive.pose.x + CHAIR.front_m < GATE_X - 0.2


class Agent:
    """A robot that others see as a person: it follows the same rules as they do."""

    def __init__(self, start: Pose2, goal: Pose2, sets_out_s: float) -> None:
        self.other: Agent | None = None
        self.story = Story(self._paint, gate())
        self.story.drive.pose, self.goal, self.sets_out_s = start, goal, sets_out_s
        self.sent = self.arrived = False

    @property
    def pose(self) -> Pose2:
        return self.story.drive.pose

    def _paint(self, now_s: float, x: Array, y: Array) -> np.ndarray:
        assert self.other is not None
        other = self.other.pose
        return paint_gate(now_s, x, y) | (np.hypot(x - other.x, y - other.y) < 0.3)

    def tick(self) -> None:
        if not self.sent and self.story.now_s >= 10.0 + self.sets_out_s:
            self.sent = True
            assert self.story.go(self.goal) == ""
        output = self.story.tick()
        assert output.end is None or output.end.succeeded, output.end
        self.arrived = self.arrived or output.reached

    def gap_m(self) -> float:
        assert self.other is not None
        at = np.array([(self.other.pose.x, self.other.pose.y, 0.0, 0.0, 0.3, 0.2)])
        return nearest_m(self.pose, ROBOT.footprint, at)


@pytest.mark.parametrize("seed", range(2))
def test_two_who_follow_the_same_rules_both_pass_a_gate(seed: int) -> None:
    random = np.random.default_rng(seed)
    (ay, by, az, bz), late_s = random.uniform(3.5, 6.5, 4), float(random.uniform(0.0, 4.0))
    one = Agent(Pose2(3.0, ay, 0.0), Pose2(13.5, az, 0.0), 0.0)
    two = Agent(Pose2(13.0, by, math.pi), Pose2(2.5, bz, math.pi), late_s)
    one.other, two.other = two, one
    for _ in range(round(120.0 / 0.05)):
        one.tick()
        two.tick()
        assert min(one.gap_m(), two.gap_m()) > 0.0
        if one.arrived and two.arrived:
            break
    assert one.arrived
    assert two.arrived

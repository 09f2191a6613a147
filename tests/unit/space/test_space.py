"""The model of the space alone: how sensor looks change it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from robot_stack.core.config import load
from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.core.robot import load_robot
from robot_stack.perception.params import PerceptionParams, SpaceParams
from robot_stack.perception.space.kernels import FREE, OCCUPIED, UNSEEN
from robot_stack.perception.space.space import Space
from robot_stack.perception.space.view import BIN_M, RISE_M, View, view_of_beams

PARAMS = load(PerceptionParams, "perception_pipeline").space
ROBOT = load_robot()
LOW, HIGH = (0.45, 0.0, 0.15), (0.45, 0.0, 1.20)  # a planar scanner in front of the chassis, and one above most objects
REACH_M = 4.0


class Scanner:
    """A planar scanner at the robot's front, one beam per degree, and the space built from it."""

    def __init__(self, origin_m: tuple[float, float, float] = LOW) -> None:
        self.space = Space(PARAMS, ROBOT)
        self.origin_m = origin_m
        self.now_s = 10.0

    def look(
        self, *walls: tuple[float, float, float], pose: Pose2 = IDENTITY, times: int = 1, vouch: bool = True
    ) -> Scanner:
        """walls: (from bearing, to bearing, range), deg and m. vouch: beams without a return are free up to REACH_M."""
        for _ in range(times):
            self.now_s += 0.1
            self.space.observe(self.view(*walls, vouch=vouch), pose)
        return self

    def view(self, *walls: tuple[float, float, float], vouch: bool = True) -> View:
        bearings = np.radians(np.arange(-89.5, 90.0, 1.0))
        ranges = np.full(len(bearings), REACH_M if vouch else 0.5 * BIN_M)
        returned = np.zeros(len(bearings), np.bool_)
        for begin, end, away in walls:
            met = (np.degrees(bearings) >= begin) & (np.degrees(bearings) <= end)
            ranges[met], returned[met] = away, True
        ends = np.array(self.origin_m) + np.stack(
            [ranges * np.cos(bearings), ranges * np.sin(bearings), np.zeros(len(bearings))], axis=1
        )
        own = np.abs(ends[:, :2]).max(axis=1) < 0.3
        return view_of_beams(self.now_s, self.origin_m, ends, returned, own, REACH_M)

    def at(self, x_m: float, y_m: float) -> int:
        grid = self.space.grid()
        column, row = ((value - low) / grid.cell_m for value, low in zip((x_m, y_m), grid.corner_m, strict=True))
        return int(grid.state[math.floor(row), math.floor(column)])

    def remembered(self, pose: Pose2 = IDENTITY) -> NDArray[np.float32]:
        return self.space.remembered(pose, self.now_s - 0.05)


WALL = (-10.0, 10.0, 1.52)  # at x = 1.97 straight ahead
SEEN = (1.97, 0.02)


def test_free_is_where_a_ray_passed_and_nowhere_else() -> None:
    scanner = Scanner().look(WALL)
    assert scanner.at(*SEEN) == OCCUPIED
    assert scanner.at(1.5, 0.0) == scanner.at(2.5, 2.0) == FREE
    assert scanner.at(3.0, 0.0) == UNSEEN  # behind the wall
    assert scanner.at(-1.0, 0.0) == UNSEEN  # behind the robot
    assert scanner.at(0.0, 0.0) == scanner.at(-0.45, 0.3) == FREE  # the robot itself
    assert scanner.at(4.8, 0.0) == UNSEEN  # beyond the scanner's reach


def test_occupied_stays_until_rays_pass_through_it() -> None:
    scanner = Scanner().look(WALL, times=2)
    scanner.look(times=PARAMS.passes - 1)
    assert scanner.at(*SEEN) == OCCUPIED
    scanner.look()
    assert scanner.at(*SEEN) == FREE


def test_a_return_now_and_then_is_enough_to_stay() -> None:
    scanner = Scanner().look(WALL)
    for _ in range(10):
        scanner.look(times=PARAMS.passes - 1).look(WALL)
    assert scanner.look(times=PARAMS.passes - 1).at(*SEEN) == OCCUPIED


@pytest.mark.parametrize("how", ["hidden", "not vouched for", "above"])
def test_occupied_cells_without_rays_are_kept(how: str) -> None:
    scanner = Scanner().look(WALL)
    if how == "hidden":
        scanner.look((-20.0, 20.0, 0.80), times=50)
    elif how == "above":
        scanner.origin_m = HIGH
        scanner.look(times=50)
    else:
        scanner.look(times=50, vouch=False)
    scanner.now_s += 3600.0
    scanner.look((-20.0, 20.0, 0.80), vouch=False)
    assert scanner.at(*SEEN) == OCCUPIED
    found = scanner.remembered()
    assert np.hypot(found[:, 0] - SEEN[0], found[:, 1] - SEEN[1]).min() < 0.05
    assert found[:, 2].max() == pytest.approx(LOW[2] + RISE_M)


def test_unobserved_free_cells_become_unseen() -> None:
    scanner = Scanner().look(WALL)
    for _ in range(round(PARAMS.fade_s / 0.1)):
        scanner.look((-20.0, 20.0, 0.80))
    assert scanner.at(1.5, 0.0) == FREE
    scanner.look((-20.0, 20.0, 0.80))
    assert scanner.at(1.5, 0.0) == UNSEEN
    assert scanner.at(1.1, 0.0) == FREE  # in front of the wall


HOLLOW = (1.5, 0.0)  # below the rays: seen only from near by


def look_past(scanner: Scanner, *hits: tuple[float, float, float], times: int = 1) -> None:
    """Looks whose rays pass everywhere except over a strip of 0.3 m ahead. hits: the returns."""
    for _ in range(times):
        scanner.now_s += 0.1
        bare = scanner.view()
        passed = bare.passed_m.copy()
        passed[170:190, round(0.9 / BIN_M) : round(1.3 / BIN_M)] = np.inf
        points = np.array(hits, np.float32).reshape(-1, 3)
        scanner.space.observe(replace(bare, hits=points, passed_m=passed), IDENTITY)


def test_enclosed_free_cells_stay_free_until_a_return_beside_them() -> None:
    scanner = Scanner().look()
    look_past(scanner, times=50)
    assert scanner.at(*HOLLOW) == FREE
    look_past(scanner, (1.5, 1.5, 0.5))
    assert scanner.at(*HOLLOW) == FREE
    look_past(scanner, (1.5, 0.35, 0.5))
    assert scanner.at(*HOLLOW) == UNSEEN
    look_past(scanner, times=20)
    assert scanner.at(*HOLLOW) == UNSEEN
    assert scanner.look().at(*HOLLOW) == FREE


def row_of(x_m: float, top_m: float = 0.5) -> list[tuple[float, float, float]]:
    """Returns of an object 0.3 m wide across the way; the strip of ``look_past`` ends at 1.75 m."""
    return [(x_m, y, top_m) for y in np.arange(-0.15, 0.16, 0.05)]


def vanishes(scanner: Scanner) -> int:
    """Places at which the views of half a second without returns lose an object."""
    count = 0
    for _ in range(5):
        look_past(scanner)
        count += len(scanner.space.vanished(IDENTITY))
    return count


@pytest.mark.parametrize("times", [5, 100], ids=["just arrived", "there for long"])
def test_an_object_that_is_lost_beside_hidden_space_is_in_it(times: int) -> None:
    scanner = Scanner()
    look_past(scanner, *row_of(1.82), times=times)
    assert vanishes(scanner) >= 4
    places = np.array([[1.82, 0.0, 0.5]])
    scanner.space.mark_vanished(places, IDENTITY)
    assert scanner.at(1.37, 0.02) == OCCUPIED  # no farther than where rays would show it


def test_an_object_that_goes_on_in_view_or_is_lost_elsewhere_is_not_in_hidden_space() -> None:
    scanner = Scanner()
    look_past(scanner, *row_of(3.0), times=5)
    assert vanishes(scanner) == 0  # in the open
    scanner = Scanner()
    look_past(scanner, *row_of(1.82))
    assert vanishes(scanner) == 0  # noise: one view
    scanner = Scanner()
    look_past(scanner, *row_of(1.82, PARAMS.low_m), times=5)
    assert vanishes(scanner) == 0  # a kerb, or ground classified as one
    for way_m in (0.02, 0.2):  # it leaves at 0.2 and at 2 m/s
        scanner = Scanner()
        look_past(scanner, *row_of(1.82), times=5)
        for x in np.arange(1.82, 3.2, way_m):
            look_past(scanner, *row_of(float(x)))
            assert len(scanner.space.vanished(IDENTITY)) == 0, (way_m, x)


def test_an_object_that_few_returns_keep_is_observed() -> None:
    """The last of a creeping cart returns too little for an object for seconds."""
    scanner = Scanner()
    look_past(scanner, *row_of(1.82), times=5)
    for _ in range(30):
        scanner.now_s += 0.1
        bare = scanner.view()
        passed = bare.passed_m.copy()
        passed[170:190, round(0.9 / BIN_M) : round(1.3 / BIN_M)] = np.inf
        scanner.space.observe(replace(bare, specks=np.array(row_of(1.82), np.float32), passed_m=passed), IDENTITY)
        assert len(scanner.space.vanished(IDENTITY)) == 0
    assert vanishes(scanner) >= 4


def test_enclosed_cells_that_were_not_free_stay_unseen() -> None:
    scanner = Scanner()
    look_past(scanner, times=20)
    assert scanner.at(*HOLLOW) == UNSEEN


def test_few_returns_occupy_no_cell_and_keep_occupied_cells() -> None:
    """A thin pole far from the sensor: most rays pass beside it and few return."""
    for specks, after in (([(1.99, 0.04, 0.3)], OCCUPIED), ([(2.5, 0.0, 0.3)], FREE), ([(math.nan, 0.0, 0.3)], FREE)):
        scanner = Scanner().look(WALL)
        for _ in range(3 * PARAMS.passes):
            scanner.now_s += 0.1
            bare = scanner.view()
            few = np.array(specks, np.float32)
            scanner.space.observe(replace(bare, specks=few), IDENTITY)
        assert scanner.at(*SEEN) == after
        assert scanner.at(2.52, 0.02) == FREE


def test_views_of_two_sensors_may_arrive_out_of_order() -> None:
    """One look arrives 0.05 s late with its older pose. It must not overwrite the other sensor's newer look."""
    scanner, late, now = Scanner().look(WALL), Scanner(), Pose2(0.10, 0.0, 0.0)
    for _ in range(200):
        scanner.look((-90.0, -20.0, 0.60), (-20.0, 20.0, 0.80), pose=now)
        late.now_s = scanner.now_s - 0.05
        scanner.space.observe(late.view(vouch=False), IDENTITY)
    assert scanner.at(1.0, 1.5) == FREE
    assert scanner.at(*SEEN) == OCCUPIED


def test_clock_set_back_clears_the_grid() -> None:
    scanner = Scanner().look(WALL)
    assert scanner.space.is_visible(1.5, 0.0, 1.0)
    scanner.now_s -= PARAMS.fade_s + 0.2
    scanner.look(vouch=False)
    assert scanner.at(*SEEN) == scanner.at(1.5, 0.0) == UNSEEN
    assert not scanner.space.is_visible(1.5, 0.0, 1.0), "by rays of the time before"
    assert scanner.look().at(1.5, 0.0) == FREE


def test_rays_above_a_place_neither_make_nor_keep_it_free() -> None:
    scanner = Scanner(HIGH).look()
    assert scanner.at(1.5, 0.0) == UNSEEN
    scanner.origin_m = LOW
    scanner.look()
    scanner.origin_m = HIGH
    scanner.look(times=10)
    assert scanner.at(1.5, 0.0) == UNSEEN


def test_ray_between_two_heights_keeps_free_cells_and_frees_none() -> None:
    scanner = Scanner().look()
    scanner.origin_m = (0.45, 0.0, 0.5 * (PARAMS.free_below_m + ROBOT.lidar_xyz_m[2]))
    scanner.look(times=20)
    assert scanner.at(1.5, 0.0) == FREE
    assert Scanner(scanner.origin_m).look(times=20).at(1.5, 0.0) == UNSEEN


def test_cleared_object_without_visible_ground_leaves_unseen_cells() -> None:
    scanner = Scanner((0.45, 0.0, 0.50)).look(WALL).look(times=PARAMS.passes)
    assert scanner.at(*SEEN) == UNSEEN


def test_a_foot_belongs_to_the_leg_above_it() -> None:
    def look(scanner: Scanner, *hits: tuple[float, float, float]) -> None:
        scanner.now_s += 0.1
        bare, points = scanner.view(), np.array(hits, np.float32).reshape(-1, 3)
        scanner.space.observe(replace(bare, hits=points), IDENTITY)

    for leg, gone in (((1.62, 0.0, 0.8), True), ((1.62, 0.6, 0.8), False)):
        scanner = Scanner((0.45, 0.0, 0.30))
        look(scanner, (1.52, 0.0, 0.10), leg)
        for _ in range(PARAMS.passes):
            look(scanner)
        assert (scanner.at(1.52, 0.0) == UNSEEN) == gone


@pytest.mark.parametrize(
    ("top_m", "ground_deg", "after"),
    [
        (0.06, (-90, 90), FREE),
        (0.06, (-90, 0), OCCUPIED),  # ground seen in half of its cell only
        (0.06, (10, 90), OCCUPIED),  # ground seen beside it only
        (0.16, (-90, 90), OCCUPIED),  # a foot or a dog: stays until rays pass below its top
    ],
)
def test_low_object_is_cleared_where_ground_is_observed(top_m: float, ground_deg: tuple[int, int], after: int) -> None:
    scanner = Scanner((0.45, 0.0, 0.14))
    hit, seen = np.array([(*SEEN, top_m)], np.float32), scanner.view().bare
    seen[180 + ground_deg[0] : 180 + ground_deg[1]] = True
    for number in range(PARAMS.passes + 1):
        scanner.now_s += 0.1
        look = scanner.view()
        assert scanner.at(*SEEN) == (OCCUPIED if number else UNSEEN)
        scanner.space.observe(replace(look, hits=look.hits if number else hit, bare=seen), IDENTITY)
    assert scanner.at(*SEEN) == after
    scanner.now_s += 0.1
    scanner.space.observe(replace(scanner.view(), hits=hit, bare=seen), IDENTITY)
    assert scanner.at(*SEEN) == OCCUPIED  # a current return


def test_rays_beside_a_pole_do_not_clear_it() -> None:
    """Half of the beams through its cell pass the pole."""
    scanner = Scanner().look((-1.0, 1.0, 0.62))
    scanner.look((0.0, 2.0, 0.62), times=10)
    assert scanner.at(1.07, 0.01) == OCCUPIED


def test_driven_distance_ages_cells_and_time_does_not() -> None:
    scanner = Scanner().look(WALL)
    step = Pose2(0.0, 0.25, 0.0)
    pose = IDENTITY
    for k in range(int(PARAMS.memory_m / 0.25) + 2):
        assert scanner.at(*SEEN) == (OCCUPIED if 0.25 * k <= PARAMS.memory_m else UNSEEN)
        pose = step if pose == IDENTITY else IDENTITY
        scanner.look(pose=pose, vouch=False)
    turning = Scanner().look(WALL)
    for k in range(int(PARAMS.memory_m / PARAMS.lever_m / 0.5) + 2):
        turning.look(pose=Pose2(0.0, 0.0, 0.5 * k), vouch=False)
    assert turning.at(*SEEN) == UNSEEN


def test_objects_keep_their_position_and_leave_with_the_grid() -> None:
    scanner = Scanner().look(WALL)
    scanner.look(pose=Pose2(0.30, -0.20, 0.5), vouch=False)
    assert scanner.at(*SEEN) == OCCUPIED
    found = scanner.remembered(Pose2(0.30, -0.20, 0.5))
    back = [Pose2(0.30, -0.20, 0.5).compose(Pose2(float(x), float(y), 0.0)) for x, y, _ in found]
    assert min(math.hypot(p.x - SEEN[0], p.y - SEEN[1]) for p in back) < 0.05
    for x in np.arange(0.3, -4.0, -0.4):
        scanner.look(pose=Pose2(float(x), 0.0, 0.0), vouch=False)
    scanner.look(pose=Pose2(-3.6, 0.0, 0.0), vouch=False).look(pose=Pose2(0.0, 0.0, 0.0), vouch=False)
    assert scanner.at(*SEEN) == UNSEEN


@pytest.mark.parametrize("elapsed_s", [-0.05, 0.0, 0.05, 0.5])
def test_odometry_restarts_where_the_robot_cannot_have_moved(elapsed_s: float) -> None:
    space, begin = Scanner().look(WALL, pose=Pose2(3.0, -1.0, 2.0)).space, Pose2(3.0, -1.0, 2.0)
    way_m = ROBOT.empty.max_speed_mps * abs(elapsed_s) + PARAMS.jump_m
    turn_rad = ROBOT.empty.max_yaw_rate_radps * abs(elapsed_s) + PARAMS.jump_rad
    for share, jumped in ((0.99, False), (1.01, True)):
        for step in (Pose2(0.0, share * way_m, 0.0), Pose2(0.0, 0.0, -share * turn_rad)):
            assert space.has_jumped(begin.compose(step), 10.1 + elapsed_s) is jumped
    assert not Space(PARAMS, ROBOT).has_jumped(begin, 10.0)


def test_non_finite_own_and_far_points_are_ignored() -> None:
    scanner = Scanner()
    hits = np.array([(math.nan, 0.0, 0.3), (1.5, math.inf, 0.3), (0.4, 0.2, 0.3), (90.0, 0.0, 0.3)], np.float32)
    bare = scanner.view()
    scanner.space.observe(replace(bare, stamp_s=20.0, hits=hits), IDENTITY)
    assert not (scanner.space.grid().state == OCCUPIED).any()
    ends = np.array([(math.nan, 0.0, 0.2), (2.0, 0.0, 0.15)], np.float32)
    view = view_of_beams(20.0, LOW, ends, np.array([True, True]), np.zeros(2, np.bool_), REACH_M)
    assert len(view.hits) == 1


def test_frontier_is_the_boundary_of_known_space_without_specks() -> None:
    scanner = Scanner().look(WALL)
    ends = scanner.space.frontier(IDENTITY)
    behind = ends[(ends[:, 0] > 2.0) & (np.abs(ends[:, 1]) < 1.0)]
    assert len(behind) > 10
    assert not ((ends[:, 0] > 0.6) & (ends[:, 0] < 1.8) & (np.abs(ends[:, 1]) < 0.5)).any()
    grid = scanner.space.grid()
    row, column = (math.floor((v - low) / grid.cell_m) for v, low in zip((0.0, 1.2), grid.corner_m[::-1], strict=True))
    grid.state[row, column] = UNSEEN
    assert len(scanner.space.frontier(IDENTITY)) == len(ends)
    turned = scanner.space.frontier(Pose2(0.0, 0.0, math.pi / 2))
    assert np.sort(turned[:, 1])[0] == pytest.approx(-ends[:, 0].max(), abs=1e-5)


def test_chair_region_is_free_while_attached_and_unseen_afterwards() -> None:
    scanner = Scanner().look((-30.0, 30.0, 0.60))
    assert len(scanner.remembered()) == 0  # currently seen
    scanner.space.chair(True)
    scanner.space.chair(True)
    scanner.look(vouch=False)
    assert scanner.at(1.0, 0.0) == FREE
    assert not (scanner.space.grid().state == OCCUPIED).any()
    scanner.space.chair(False)
    scanner.look(vouch=False)
    assert scanner.at(1.0, 0.0) == UNSEEN
    assert scanner.at(0.2, 0.0) == FREE


def test_a_chair_before_the_first_look() -> None:
    space = Space(PARAMS, ROBOT)
    space.chair(True)
    space.observe(Scanner().view(), IDENTITY)
    assert (space.grid().state == FREE).any()


@pytest.mark.parametrize(
    ("field", "value"), [("cell_m", 0.0), ("passes", 0), ("fade_s", math.nan), ("free_below_m", 0.0), ("size_m", None)]
)
def test_bad_parameters_are_refused_by_name(field: str, value: object) -> None:
    with pytest.raises(ValidationError, match=field):
        SpaceParams.model_validate({**PARAMS.model_dump(), field: value})

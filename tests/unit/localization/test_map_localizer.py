"""Localization against a map, as stories in fake time: wrong starts, kidnapping, frozen and covered sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from robot_stack.core.config import load
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2, exp_se2
from robot_stack.core.levels import Area, Levels
from robot_stack.core.point_cloud import SWEEP, Points
from robot_stack.localization.gyro import ImuSample
from robot_stack.localization.localizer import Estimate
from robot_stack.localization.map_localizer import MapLocalizer
from robot_stack.localization.ndt.gate import Confidence, problem_of
from robot_stack.localization.ndt.matcher import pose_of as pose4
from robot_stack.localization.ndt.search import Region, search
from robot_stack.localization.ndt.solver import MatchRequest, SweepSolver
from robot_stack.safety.params import SafetyParams
from tests.unit.localization.courtyard import (
    UP,
    Place,
    apron,
    apron_solver,
    corridor_solver,
    corridor_with_posts,
    matcher,
    seen_from,
    solver,
    surfaces,
    sweep_from,
    twins,
    twins_solver,
    yaw_between,
)
from tests.unit.localization.stories import IMU_S, params, reading

STAND, AHEAD = Twist2(0.0, 0.0, 0.0), Twist2(0.5, 0.0, 0.0)
FAST, BACK = Twist2(1.4, 0.0, 0.0), Twist2(-1.4, 0.0, 0.0)
# Below this quality the safety monitor raises LOCALIZATION_LOST.
LOST = load(SafetyParams, "safety_monitor").lost_quality
_ODOM_EVERY, _SWEEP_EVERY = 2, 10
_SEEDS = iter(range(100, 100_000))


@dataclass
class Ride:
    """A robot in the courtyard: wheels, a gyro, and sweeps from its true pose, each matched 20 ms later.

    seen: sweep to use instead of the true one. share: fraction of the wheels' speed that the robot makes. slide_mps:
    its speed to the left while sliding.
    """

    localizer: MapLocalizer
    truth: Pose2
    wheels: Pose2 = IDENTITY
    t_s: float = 100.0
    steps: int = 0
    lidar_on: bool = True
    imu_on: bool = True
    place: Place = surfaces
    solver: SweepSolver = field(default_factory=solver)
    seen: Points | None = None
    share: float = 1.0
    slide_mps: float = 0.0
    asked: MatchRequest | None = None
    random: np.random.Generator = field(default_factory=lambda: np.random.default_rng(5))

    def drive(self, seconds: float, twist: Twist2 = STAND) -> Ride:
        for _ in range(round(seconds / IMU_S)):
            self._step(twist)
        return self

    def _step(self, twist: Twist2) -> None:
        self.t_s, self.steps = self.t_s + IMU_S, self.steps + 1
        made = Twist2(twist.vx * self.share, twist.vy * self.share + self.slide_mps, twist.omega)
        self.truth = self.truth.compose(exp_se2(made, IMU_S))
        self.wheels = self.wheels.compose(exp_se2(twist, IMU_S))
        rate = twist.omega + 0.002 * self.random.standard_normal()
        if self.imu_on:
            self.localizer.on_imu(ImuSample(self.t_s, rate, (rate,)))
        if self.steps % _ODOM_EVERY == 0:
            self.localizer.on_odometry(reading(self.t_s, self.wheels, twist), self.t_s)
            self._match()
        if self.steps % _SWEEP_EVERY == 1 and self.lidar_on:
            self.localizer.on_sweep(self._sweep(), self.t_s)

    def _sweep(self) -> Points:
        if self.seen is not None:
            return self.seen
        sweep = sweep_from(self.truth, next(_SEEDS), density=5.0, place=self.place)
        sweep["time"] = 0.0  # no distortion, which another test covers
        return sweep

    def _match(self) -> None:
        if self.asked is not None:
            self.localizer.answer(self.solver.solve(self.asked), self.t_s)
            self.asked = None
        self.asked = self.localizer.request()

    def estimate(self) -> Estimate:
        return self.localizer.estimate(self.t_s)

    @property
    def quality(self) -> float:
        return self.estimate().quality

    def error_m(self) -> float:
        pose = self.estimate().pose
        return pose.distance_to(self.truth)


def ride(truth: Pose2 = IDENTITY, start: Pose2 = IDENTITY, **changes: object) -> Ride:
    given = params(start_x_m=start.x, start_y_m=start.y, start_yaw_rad=start.yaw, **changes)
    return Ride(MapLocalizer(given, 1.5, 1.0, matcher()), truth)


def apron_ride(at_x_m: float, **changes: object) -> Ride:
    """Starts east of the courtyard. The LiDAR of these tests sees 25 m, so nothing from x = 37 on."""
    start = Pose2(at_x_m, 1.0, 0.0)
    given = params(start_x_m=start.x, start_y_m=start.y, start_yaw_rad=start.yaw, **changes)
    site = apron_solver()
    return Ride(MapLocalizer(given, 1.5, 1.0, site.matcher), start, place=apron, solver=site)


def on_the_way_out() -> Ride:
    story = apron_ride(31.0).drive(2.0)
    assert story.localizer.confidence is Confidence.TRACKING
    return story


def out_in_the_open() -> Ride:
    story = on_the_way_out().drive(6.0, FAST)
    assert story.localizer.confidence is Confidence.DEAD_RECKONING
    return story


def test_a_start_one_metre_and_ten_degrees_wrong_is_found_within_a_few_sweeps() -> None:
    story = ride(start=Pose2(0.7, -0.7, math.radians(10.0)))
    for nonsense in (np.array([0.0, 0.0, np.nan]), np.array([3.0, 0.0, 1.0])):
        story.localizer.on_up(nonsense)  # of the IMU: not taken
    story.drive(0.05)
    assert story.quality < 0.3
    story.drive(0.3)
    assert story.error_m() < 0.03
    assert story.quality < 0.3  # found, but not yet confirmed
    story.drive(0.7)
    assert story.localizer.confidence is Confidence.TRACKING
    assert story.quality > 0.8


def test_the_pose_follows_a_drive_and_outlives_wheels_that_slide() -> None:
    story = ride().drive(1.0).drive(2.0, AHEAD)
    assert story.error_m() < 0.02
    story.truth = story.truth.compose(Pose2(0.15, 0.1, 0.02))  # pushed: wheels and gyro did not measure it
    story.drive(1.0)
    assert story.error_m() < 0.05
    assert story.localizer.confidence is Confidence.TRACKING


SLIPS = "wheels slip: map and wheels disagree on the motion"


@pytest.mark.parametrize(
    ("reported", "share", "slide_mps"),
    [
        pytest.param(0.5, 0.5, 0.0, id="half"),
        pytest.param(1.4, 0.0, 0.0, id="on the spot"),
        pytest.param(0.5, 1.0, 0.3, id="sideways"),
        pytest.param(0.0, 1.0, 0.15, id="at rest"),
    ],
)
def test_while_wheels_slip_the_pose_follows_the_map(reported: float, share: float, slide_mps: float) -> None:
    """Without slip detection, wheels that spun on the spot at 1.0 m/s moved the pose by 0.65 m, and it was lost."""
    story = ride(Pose2(-4.0, 0.0, 0.0), Pose2(-4.0, 0.0, 0.0)).drive(2.0)
    assert SLIPS not in story.estimate().faults
    story.share, story.slide_mps = share, slide_mps
    for k in range(20):
        story.drive(0.1, Twist2(reported, 0.0, 0.0))
        assert story.error_m() < 0.18
        assert story.localizer.slip is None or story.error_m() < 3.0 * story.estimate().position_sigma_m
        assert story.localizer.confidence is Confidence.TRACKING
        assert k < 10 or SLIPS in story.estimate().faults
    story.share, story.slide_mps = 1.0, 0.0
    story.drive(0.3, Twist2(reported, 0.0, 0.0)).drive(1.2)
    assert SLIPS not in story.estimate().faults
    assert story.error_m() < 0.03


def test_no_slip_is_detected_on_good_ground() -> None:
    story = ride().drive(1.0)
    for twist in (AHEAD, Twist2(0.0, 0.3, 0.0), Twist2(0.3, 0.0, 0.5), BACK, Twist2(0.0, 0.0, -0.8)):
        for _ in range(15):
            story.drive(0.1, twist)
            assert story.localizer.slip is None


def slipping() -> Ride:
    story = ride(Pose2(-4.0, 0.0, 0.0), Pose2(-4.0, 0.0, 0.0)).drive(2.0)
    story.share = 0.0
    story.drive(0.5, AHEAD)
    assert story.localizer.slip is not None
    return story


def test_a_slip_that_no_match_confirms_any_more_is_forgotten() -> None:
    story = slipping()
    story.lidar_on = False
    story.drive(0.5)
    assert story.localizer.slip is not None
    story.drive(0.8)
    assert story.localizer.slip is None


def test_pose_reset_or_odometry_restart_clears_slip() -> None:
    story = slipping()
    story.localizer.reset(story.truth, np.diag([0.01, 0.01, 0.01]), story.t_s)
    assert story.localizer.slip is None
    story = slipping()
    story.wheels = Pose2(50.0, 0.0, 0.0)
    story.drive(0.02)
    assert story.localizer.slip is None


def test_a_kidnapped_robot_stops_within_a_second_and_finds_itself() -> None:
    story = ride().drive(1.2)
    assert story.quality > 0.5
    story.truth = Pose2(8.5, -3.0, 2.5)
    story.drive(1.0)
    assert story.quality < 0.3
    for _ in range(40):
        story.drive(0.1)
        assert story.quality < 0.5 or story.error_m() < 0.1  # no confidence in a wrong pose
    assert story.error_m() < 0.05
    assert story.localizer.confidence is Confidence.TRACKING
    assert story.quality > 0.5


def test_repeated_equal_sweeps_are_reported_as_frozen_and_a_silent_sensor_lowers_the_quality() -> None:
    story = ride().drive(1.2)
    story.seen = sweep_from(story.truth, 55, density=5.0)
    story.drive(0.3)
    assert story.quality > 0.5
    story.drive(2.0)
    assert story.quality < 0.3
    assert any("frozen" in fault for fault in story.estimate().faults)
    story.seen = None
    story.drive(0.5)
    assert story.quality > 0.5
    story.lidar_on = False
    assert story.drive(0.3).quality > 0.5
    assert story.drive(1.5).quality < 0.3


@pytest.mark.parametrize("points", [0, 150_000])
def test_a_covered_or_empty_sensor_lowers_the_quality_but_not_the_pose(points: int) -> None:
    story = ride().drive(1.2)
    blind = np.zeros(points, SWEEP)
    blind["x"] = 0.6
    if points > 10:
        blind["x"][::2] = np.nan
    for count in range(20):
        if points:
            blind["intensity"] = count
        story.seen = blind.copy()
        story.drive(0.1)
    assert story.quality < 0.3
    assert story.error_m() < 0.05
    story.seen = None
    story.drive(0.6)
    assert story.quality > 0.5


def test_initialpose_is_taken_and_has_to_prove_itself() -> None:
    story = ride().drive(1.2)
    story.localizer.reset(Pose2(0.5, 0.4, 0.1), story.localizer.start_covariance(), story.t_s)
    assert story.quality < 0.3
    story.drive(1.0)
    assert story.error_m() < 0.03
    assert story.quality > 0.5


def test_a_sweep_of_the_future_waits_and_an_old_one_is_refused() -> None:
    story = ride().drive(1.2)
    story.lidar_on = False
    story.drive(0.1)
    late = sweep_from(story.truth, 77, density=5.0)
    story.localizer.on_sweep(late, story.t_s + 0.05)
    assert story.localizer.request() is None
    before = story.localizer.match
    story.drive(0.1)
    assert story.localizer.match is not before
    story.localizer.on_sweep(sweep_from(story.truth, 78, density=5.0), story.t_s - 50.0)
    assert story.localizer.request() is None
    assert any("older" in fault for fault in story.estimate().faults)


def test_answers_to_questions_from_before_a_reset_are_dropped() -> None:
    story = ride().drive(1.2)
    while story.asked is None:
        story.drive(0.02)
    answer = solver().solve(story.asked)
    story.localizer.reset(Pose2(3.0, 0.0, 0.0), 0.01 * np.eye(3), story.t_s)
    story.localizer.answer(answer, story.t_s)
    pose = story.estimate().pose
    assert pose.x == pytest.approx(3.0, abs=1e-6)


def test_global_search_finds_pose_and_is_unambiguous() -> None:
    truth = Pose2(2.0, -4.0, 2.0)
    points = seen_from(pose4(truth, 0.02, UP), surfaces(5.0, seed=9))
    found = search(matcher(), points, UP, Region(0.0, 0.0, math.inf), params().ndt.search)
    assert found.clear(params().ndt.search)
    assert found.best.planar.distance_to(truth) < 0.02
    assert yaw_between(found.best.planar, truth) < 0.005
    assert not search(matcher(), points[:0], UP, Region(0.0, 0.0, 4.0), params().ndt.search).clear(params().ndt.search)


def test_each_gate_names_its_reason() -> None:
    truth = pose4(IDENTITY, 0.02, UP)
    good = matcher().match(seen_from(truth, surfaces(5.0, seed=9)), truth, UP, 0.1)
    gate = params().ndt.gate
    assert problem_of(good, IDENTITY, 0.01, 0.001, gate) == ""
    tilted = good.pose.copy()
    tilted[2, 2] = 0.9
    for changed, word in (
        (replace(good, converged=False), "converged"),
        (replace(good, reversals=99), "reversals"),
        (replace(good, structure=3), "points above the ground"),
        (replace(good, score=0.1), "score"),
        (replace(good, pose=tilted), "tilt"),
        (replace(good, covariance=100.0 * np.eye(6)), "sigma"),
    ):
        assert word in problem_of(changed, IDENTITY, 0.01, 0.001, gate)
    assert "jump of 2.0" in problem_of(good, Pose2(2.0, 0.0, 0.0), 0.01, 0.001, gate)
    assert "rad" in problem_of(good, Pose2(0.0, 0.0, 1.0), 0.01, 0.001, gate)
    assert problem_of(good, Pose2(2.0, 0.0, 0.0), 1.0, 0.2, gate) == ""


def test_clock_set_back_drops_pending_match_request() -> None:
    story = ride().drive(1.2)
    story.lidar_on = False
    story.drive(0.1)
    story.localizer.on_odometry(reading(5.0, story.wheels, ZERO_TWIST), story.t_s)
    assert story.localizer.request() is None
    assert story.estimate().pose is not None


def test_dead_reckoning_over_open_ground_then_tracking_resumes() -> None:
    story = on_the_way_out()
    before = story.quality
    qualities, variances = [], []
    for _ in range(10):
        story.drive(1.0, FAST)
        qualities.append(story.quality)
        variances.append(float(story.estimate().covariance[0, 0]))
    assert story.localizer.confidence is Confidence.DEAD_RECKONING
    assert min(qualities) > LOST
    assert qualities[5:] == sorted(qualities[5:], reverse=True)
    assert qualities[-1] < before
    assert variances[5:] == sorted(variances[5:])
    assert story.error_m() < 0.1
    for _ in range(11):
        story.drive(1.0, BACK)
        assert story.quality > LOST
    assert story.localizer.confidence is Confidence.TRACKING
    assert story.quality > 0.8
    assert story.error_m() < 0.03


def test_after_thirty_metres_of_open_ground_the_pose_is_given_up() -> None:
    story = on_the_way_out()
    left_x_m = story.truth.x
    while story.localizer.confidence is not Confidence.SEARCHING:
        assert story.truth.x < 75.0
        story.drive(0.1, FAST)
        if story.localizer.confidence is Confidence.TRACKING:
            left_x_m = story.truth.x
        else:
            assert story.quality > LOST or story.localizer.confidence is Confidence.SEARCHING
    assert story.truth.x - left_x_m == pytest.approx(30.0, abs=0.5)
    assert story.quality == 0.0
    assert story.estimate().covariance[0, 0] > 1e4
    story.drive(3.0)
    assert story.quality == 0.0


def test_standing_in_the_open_costs_nothing_but_a_silent_lidar_does() -> None:
    story = out_in_the_open()
    before = story.quality
    assert story.drive(5.0).quality == pytest.approx(before, abs=0.02)
    story.lidar_on = False
    assert story.drive(1.6).quality < LOST


def test_walls_that_the_map_has_and_the_sweep_does_not_are_a_contradiction() -> None:
    story = ride().drive(1.2)
    for count in range(10):
        sweep = sweep_from(story.truth, 900 + count, density=5.0)
        story.seen = sweep[sweep["z"] < -0.6]  # only the ground, as in an open field
        story.drive(0.1)
        assert story.localizer.confidence is not Confidence.DEAD_RECKONING
    assert story.quality == 0.0


def test_a_robot_carried_from_the_open_into_the_yard_is_never_sure_of_the_open() -> None:
    story = out_in_the_open()
    story.truth = Pose2(0.0, 0.0, 1.0)
    story.drive(0.6)
    assert story.quality == 0.0
    for _ in range(40):
        story.drive(0.1)
        assert story.quality < 0.5 or story.error_m() < 0.1


def test_odometry_restart_on_open_ground_loses_pose() -> None:
    story = out_in_the_open()
    story.wheels = Pose2(5.0, 5.0, 0.0)
    story.drive(0.04)
    assert story.quality == 0.0
    assert story.localizer.confidence is Confidence.SEARCHING


def test_a_start_in_the_open_is_not_confirmed() -> None:
    story = apron_ride(50.0)
    for _ in range(20):
        story.drive(0.2, AHEAD)
        assert story.quality < LOST
    assert story.localizer.confidence is Confidence.CONFIRMING


def test_search_near_known_heading_excludes_mirrored_corridor_pose() -> None:
    """A single post does not distinguish the two directions reliably."""
    search_params = params().ndt.search
    site = corridor_solver()
    truth = Pose2(10.0, 0.3, 0.1)
    points = seen_from(pose4(truth, 0.02, UP), corridor_with_posts(6.0, seed=3), 30.0)
    everywhere = search(site.matcher, points, UP, Region(10.5, 0.0, 4.0), search_params)
    assert not everywhere.clear(search_params)
    ahead = search(site.matcher, points, UP, Region(10.5, 0.0, 4.0, 0.0, search_params.near_turn_rad), search_params)
    assert ahead.clear(search_params)
    assert ahead.best.planar.distance_to(truth) < 0.3  # weakly constrained along the corridor
    assert yaw_between(ahead.best.planar, truth) < 0.02


@pytest.mark.parametrize("gap", [False, True])
def test_headings_near_the_known_one_are_looked_at_only_while_the_gyro_carries_it(gap: bool) -> None:
    story = ride().drive(1.2)
    assert story.localizer.confidence is Confidence.TRACKING
    if gap:
        story.imu_on = False
        story.drive(0.3)
        story.imu_on = True
    story.seen = sweep_from(Pose2(8.5, -3.0, 2.5), 61, density=5.0)
    for count in range(200):
        story.seen["intensity"] = count
        story.drive(0.01)
        if story.asked is not None and story.asked.region is not None:
            break
    near = params().ndt.search.near_turn_rad
    assert story.asked.region.turn_rad == (math.pi if gap else near)


def test_a_start_in_the_wrong_one_of_two_similar_places_is_corrected_without_a_known_heading() -> None:
    """The end of the hall is in view: the second courtyard explains 0.68 of the sweep, the first 0.96."""
    site, truth = twins_solver(), Pose2(-2.7, -4.0, 0.5)
    start = params(start_x_m=78.0, start_y_m=-4.0, start_yaw_rad=2.5)
    story = Ride(MapLocalizer(start, 1.5, 1.0, site.matcher), truth, place=twins, solver=site)
    for _ in range(25):
        story.drive(0.1)
        assert story.quality < LOST or story.error_m() < 0.1
    assert story.localizer.confidence is Confidence.TRACKING
    assert story.error_m() < 0.05


def lost_in_a_courtyard(truth: Pose2) -> Ride:
    """In one of two equal courtyards, with a start pose in neither, until the search has found both."""
    site = twins_solver()
    story = Ride(MapLocalizer(params(start_x_m=45.0), 1.5, 1.0, site.matcher), truth, place=twins, solver=site)
    for _ in range(30):
        story.drive(0.1)
        assert story.quality < LOST
        if story.localizer.confidence is Confidence.AMBIGUOUS:
            break
    assert story.localizer.confidence is Confidence.AMBIGUOUS
    return story


def test_between_two_places_that_look_alike_motion_decides() -> None:
    story = lost_in_a_courtyard(Pose2(-7.0, -4.0, 0.0))
    story.drive(1.0)
    assert story.localizer.confidence is Confidence.AMBIGUOUS  # standing adds no information
    for _ in range(100):
        story.drive(0.1, Twist2(1.2, 0.0, 0.0))
        assert story.quality == 0.0 or story.error_m() < 0.1
        if story.localizer.confidence is Confidence.TRACKING:
            break
    assert story.localizer.confidence is Confidence.TRACKING
    assert story.error_m() < 0.05


def test_a_search_stays_on_the_level_of_the_last_pose() -> None:
    """The equal courtyard of another level is no rival, and is found from a pose on its own level."""
    site, truth = twins_solver(), Pose2(-7.0, -4.0, 0.0)
    areas = {
        name: Area(min_x_m=x, max_x_m=x + 80.0, min_y_m=-30.0, max_y_m=30.0) for name, x in (("a", -40), ("b", 40))
    }
    for start_x_m, found_x_m in ((30.0, truth.x), (45.0, truth.x + 80.0)):
        localizer = MapLocalizer(params(start_x_m=start_x_m), 1.5, 1.0, site.matcher, Levels(levels=areas))
        story = Ride(localizer, truth, place=twins, solver=site)
        for _ in range(40):
            story.drive(0.1)
            assert localizer.confidence is not Confidence.AMBIGUOUS
        assert localizer.confidence is Confidence.TRACKING
        assert story.estimate().pose.x == pytest.approx(found_x_m, abs=0.1)


def test_ambiguous_places_keep_pose_unknown() -> None:
    """Features beyond the walls of the first courtyard are not visible from the second: that alone is no proof."""
    story = lost_in_a_courtyard(Pose2(73.0, -4.0, 0.0))
    for _ in range(8):
        story.drive(0.5, Twist2(0.6, 0.0, 0.0))
        assert story.quality == 0.0
        assert story.estimate().covariance[0, 0] > 1e4


def test_odometry_restart_discards_hypotheses() -> None:
    story = lost_in_a_courtyard(Pose2(-7.0, -4.0, 0.0))
    story.wheels = Pose2(5.0, 5.0, 0.0)
    story.drive(0.02)
    assert story.localizer.confidence is Confidence.SEARCHING

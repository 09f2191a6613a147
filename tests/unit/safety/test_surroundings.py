"""What is kept of the obstacle clouds, and where it is while the robot moves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from robot_stack.safety.collision import Outline
from robot_stack.safety.obstacle_params import BlindParams, CollisionParams, ExclusionParams, LidarParams, VolumeParams
from robot_stack.safety.reckoning import DeadReckoning, Modules
from robot_stack.safety.surroundings import Surroundings
from tests.unit.safety.story import PARAMS

BODY = Outline(0.5, -0.5, 0.35)
LIDAR_M = (0.2, 0.0, 0.7)
NONE = np.empty((0, 3))
OBSTACLES = PARAMS.obstacles
BLIND = OBSTACLES.blind


class Scene:
    """20 clouds a second around a robot that drives with a constant twist."""

    def __init__(self, twist: Twist2 | None = None) -> None:
        self.reckoning = DeadReckoning(OBSTACLES.max_latency_s)
        self.around = Surroundings(OBSTACLES, self.reckoning, LIDAR_M)
        self.twist = twist or Twist2(0.0, 0.0, 0.0)
        self.now_s = 10.0
        self.reckoning.update(self.twist, self.now_s)

    def go(self, seconds: float) -> Scene:
        for _ in range(round(seconds / 0.05)):
            self.now_s += 0.05
            self.reckoning.update(self.twist, self.now_s)
        return self

    def see(self, *points: tuple[float, float, float], latency_s: float = 0.0) -> Scene:
        self.around.received(cloud(*points), latency_s, BODY, self.now_s)
        return self

    def keep_seeing(self, seconds: float, *world: tuple[float, float, float]) -> Scene:
        """Points that stand in the dead-reckoning frame, seen again and again."""
        for _ in range(round(seconds / 0.05)):
            self.go(0.05)
            pose = self.reckoning.pose
            self.see(*((*_local(pose, x, y), z) for x, y, z in world))
        return self

    def known(self, docking: bool = False) -> list[list[float]]:
        points = self.around.points(docking, 0.3, self.now_s)
        return sorted([round(float(value), 3) for value in point] for point in points)


def cloud(*points: tuple[float, float, float]) -> NDArray[np.float64]:
    return np.array(points, np.float64).reshape(-1, 3)


def _local(pose: Pose2, x: float, y: float) -> tuple[float, float]:
    local = pose.inverse().compose(Pose2(x, y, 0.0))
    return local.x, local.y


# --- reckoning -------------------------------------------------------------------------------------------------------


def test_modules_agree_on_a_twist() -> None:
    modules = Modules(((0.3, 0.25), (0.3, -0.25), (-0.3, 0.25), (-0.3, -0.25)), 0.08)
    for twist in (Twist2(1.0, 0.0, 0.0), Twist2(0.3, -0.4, 0.0), Twist2(0.0, 0.0, 0.7), Twist2(0.5, 0.2, -0.6)):
        velocities = [(twist.vx - twist.omega * y, twist.vy + twist.omega * x) for x, y in modules.positions_m]
        found = modules.twist([math.hypot(*v) for v in velocities], [math.atan2(v[1], v[0]) for v in velocities])
        assert (found.vx, found.vy, found.omega) == pytest.approx((twist.vx, twist.vy, twist.omega))


def test_reckoning_goes_with_the_twist_and_not_over_gaps() -> None:
    reckoning = DeadReckoning(0.3)
    twist = Twist2(1.0, 0.0, 0.0)
    reckoning.update(twist, 5.0)
    assert reckoning.pose == IDENTITY
    reckoning.update(twist, 5.3)
    assert (reckoning.pose.x, reckoning.way_m) == pytest.approx((0.3, 0.3))
    reckoning.update(twist, 5.61)
    reckoning.update(twist, 5.0)  # time ran back
    assert reckoning.pose.x == pytest.approx(0.3)
    reckoning.update(Twist2(-2.0, 0.0, 0.0), 5.1)
    assert (reckoning.pose.x, reckoning.way_m) == pytest.approx((0.1, 0.5))
    assert reckoning.pose_at(5.2).x == pytest.approx(-0.1)
    assert reckoning.pose_at(5.0).x == pytest.approx(0.3)
    assert reckoning.pose_at(5.39).x == pytest.approx(0.1 - 0.58)
    assert reckoning.pose_at(5.41).x == pytest.approx(0.1)
    assert DeadReckoning(0.3).pose_at(1.0) == IDENTITY


# --- clouds ----------------------------------------------------------------------------------------------------------


def test_never_received() -> None:
    scene = Scene()
    assert (scene.around.age_s(10.0), scene.around.problem) == (math.inf, "never received")
    assert scene.known() == []


def test_points_move_past_the_robot() -> None:
    scene = Scene(Twist2(1.0, 0.0, 0.0)).see((2.0, 0.5, 1.0))
    assert scene.known() == [[2.0, 0.5, 1.0]]
    assert scene.go(0.1).known() == [[1.9, 0.5, 1.0]]
    turning = Scene(Twist2(0.0, 0.0, 1.0)).see((2.0, 0.0, 1.0)).go(0.1)
    assert turning.known() == [[round(2 * math.cos(0.1), 3), round(-2 * math.sin(0.1), 3), 1.0]]


def test_points_that_took_their_time_are_where_they_were_then() -> None:
    scene = Scene(Twist2(1.0, 0.0, 0.0)).go(0.5).see((2.0, 0.0, 1.0), latency_s=0.1)
    assert scene.known() == [[1.9, 0.0, 1.0]]
    assert scene.around.age_s(scene.now_s + 0.2) == pytest.approx(0.2)


def test_half_sweeps_make_one_picture_until_they_are_too_old() -> None:
    scene = Scene().see((3.0, 0.0, 1.0)).go(0.05).see((-3.0, 0.0, 1.0)).go(0.05)
    assert scene.known() == [[-3.0, 0.0, 1.0], [3.0, 0.0, 1.0]]
    assert scene.see().known() == [[-3.0, 0.0, 1.0], [3.0, 0.0, 1.0]]
    assert scene.go(0.05).see().known() == [[-3.0, 0.0, 1.0], [3.0, 0.0, 1.0]]
    assert scene.go(0.05).see().known() == [[-3.0, 0.0, 1.0]]
    assert scene.go(0.05).see().known() == []


def test_an_empty_cloud_is_fresh_and_shows_nothing() -> None:
    scene = Scene().see()
    assert (scene.around.age_s(scene.now_s), scene.around.problem) == (0.0, "")
    assert scene.known() == []


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_points_that_are_no_numbers_are_none(bad: float) -> None:
    scene = Scene().see((2.0, 0.0, 1.0), (bad, 0.0, 1.0), (3.0, bad, 1.0), (3.0, 1.0, bad))
    assert scene.known() == [[2.0, 0.0, 1.0]]
    scene.go(0.05).see((bad, 0.0, 1.0))
    assert scene.around.problem == "no point is finite"
    assert scene.around.age_s(scene.now_s) == pytest.approx(0.05)


@pytest.mark.parametrize("latency_s", [OBSTACLES.max_latency_s + 0.01, -0.01, math.nan, math.inf])
def test_late_and_future_clouds_count_as_not_received(latency_s: float) -> None:
    scene = Scene().see((2.0, 0.0, 1.0), latency_s=latency_s)
    assert scene.around.age_s(scene.now_s) == math.inf
    assert scene.around.problem == f"its points are {latency_s:.2f} s old"
    assert scene.see((2.0, 0.0, 1.0), latency_s=OBSTACLES.max_latency_s).around.problem == ""


def test_a_message_that_is_no_cloud() -> None:
    scene = Scene().see()
    scene.around.refused("field x is missing")
    assert scene.around.problem == "field x is missing"
    assert scene.around.age_s(scene.now_s + 1.0) == 1.0


def test_what_is_within_the_body_is_the_body() -> None:
    assert Scene().see((0.5, 0.0, 0.3), (0.0, -0.35, 0.3), (0.51, 0.0, 0.3)).known() == [[0.51, 0.0, 0.3]]


def test_of_a_column_the_nearest_point_is_kept_at_the_height_of_the_highest() -> None:
    column = [(2.04, 0.01, 0.2), (2.01, 0.01, 0.5), (2.02, 0.04, 1.5), (2.03, 0.02, 1.0)]
    assert Scene().see(*column, (2.06, 0.01, 0.1)).known() == [[2.01, 0.01, 1.5], [2.06, 0.01, 0.1]]
    behind = [(-2.01, -0.01, 0.5), (-2.04, -0.01, 0.7)]
    assert Scene().see(*behind).known() == [[-2.01, -0.01, 0.7]]


def test_far_points_are_left_out() -> None:
    radius = OBSTACLES.radius_m
    assert len(Scene().see((0.6 * radius, 0.79 * radius, 1.0)).known()) == 1
    assert Scene().see((0.6 * radius, 0.81 * radius, 1.0)).known() == []


def test_time_that_runs_back_begins_anew() -> None:
    scene = Scene().see((2.0, 0.0, 1.0))
    scene.now_s = 5.0
    assert scene.around.age_s(scene.now_s) == math.inf
    scene.see((3.0, 0.0, 1.0))
    assert scene.around.age_s(scene.now_s) == 0.0
    assert scene.known() == [[3.0, 0.0, 1.0]]


# --- what is too low and too near to be seen -------------------------------------------------------------------------

LOW, HIGH = (1.02, 0.02, 0.3), (1.02, 0.02, 1.0)  # 0.82 m from the sensor the lowest ray is 0.23 m high, less 0.1 m


def test_a_low_thing_is_remembered_where_it_cannot_be_seen() -> None:
    """From 0.87 m of the sensor on, its top is below the lowest ray and the margin."""
    scene = Scene(Twist2(0.5, 0.0, 0.0)).keep_seeing(1.0, (1.52, 0.02, 0.3))
    scene.keep_seeing(0.5)
    # 0.75 m driven: 0.77 m ahead, 0.57 m from the sensor
    assert scene.known() == [[0.77, 0.02, 0.3]]


def test_a_high_thing_that_is_seen_no_more_has_left() -> None:
    assert Scene().keep_seeing(0.5, HIGH).keep_seeing(0.3).known() == []


def test_a_low_thing_in_view_that_is_seen_no_more_has_left() -> None:
    far = (1.52, 0.02, 0.3)
    assert Scene().keep_seeing(0.5, far).keep_seeing(0.3).known() == []


def test_the_height_of_a_column_is_what_is_seen_of_it_last() -> None:
    """A person's shoe alone would stay; shoe and body together leave."""
    shoe, body = (0.82, 0.02, 0.15), (0.85, 0.04, 1.2)
    assert Scene().keep_seeing(0.5, shoe, body).keep_seeing(0.3).known() == []
    assert Scene().keep_seeing(0.5, body, shoe).keep_seeing(0.3).known() == []
    assert Scene().keep_seeing(0.5, shoe).keep_seeing(0.3).known() == [[0.82, 0.02, 0.15]]
    first_body = Scene().keep_seeing(0.5, body).keep_seeing(0.5, shoe).keep_seeing(0.3)
    assert first_body.known() == [[0.82, 0.02, 0.15]]


def test_single_points_are_not_remembered() -> None:
    near = (0.82, 0.02, 0.15)
    scene = Scene()
    for _ in range(BLIND.sightings - 1):
        scene.keep_seeing(0.05, near)
    assert scene.keep_seeing(0.3).known() == []
    scene.keep_seeing(0.05, near)
    assert scene.keep_seeing(0.3).known() == [[0.82, 0.02, 0.15]]


def test_memory_ends_with_time_and_with_the_way() -> None:
    near = (0.82, 0.02, 0.15)
    standing = Scene().keep_seeing(0.5, near)
    last_s = standing.now_s
    standing.keep_seeing(0.3)
    standing.now_s = last_s + BLIND.memory_s
    assert standing.known() == [[0.82, 0.02, 0.15]]
    standing.now_s += OBSTACLES.window_s  # for so long a cloud counts as seen
    assert standing.known() == []
    standing.now_s = last_s - 1.0
    assert standing.known() == []
    turning = Scene(Twist2(1.0, 0.0, 5.0)).keep_seeing(0.5, (0.82, 0.02, 0.15))
    seen_at_m = turning.reckoning.way_m
    turning.keep_seeing(0.3)
    assert len(turning.known()) == 1
    turning.reckoning.way_m = seen_at_m + BLIND.memory_m
    assert len(turning.known()) == 1
    turning.reckoning.way_m += 0.2  # and the way of the clouds that counted as seen
    assert turning.known() == []


def test_memory_is_near_the_robot_and_not_where_it_stands() -> None:
    scene = Scene(Twist2(0.5, 0.0, 0.0)).keep_seeing(0.5, (1.0, 0.02, 0.15)).keep_seeing(0.4)
    assert len(scene.known()) == 1
    scene.keep_seeing(0.8)  # over it: whatever it was, it did not stop the robot
    assert scene.known() == []
    assert scene.keep_seeing(3.0).known() == []
    away = Scene(Twist2(0.0, -0.9, 0.0)).keep_seeing(0.5, (0.0, 0.4, 0.10))
    assert len(away.known()) > 0
    away.keep_seeing(2.6)
    assert away.known() == []


# --- docks -----------------------------------------------------------------------------------------------------------

IN_DOCK = {
    "board": ((0.0, 0.0, 0.5), True),
    "passenger": ((0.79, -0.44, 1.5), True),
    "beyond": ((0.81, 0.0, 0.5), False),
    "beside": ((0.3, 0.46, 0.5), False),
    "above": ((0.3, 0.0, 1.61), False),
    "rail": ((-0.54, 0.31, 0.2), True),
    "castor": ((-0.2, -0.19, 0.15), True),
    "before the rails": ((-0.56, 0.31, 0.2), False),
    "leg in the middle": ((-0.2, 0.0, 0.2), False),
    "leg before the board": ((-0.03, 0.0, 0.9), False),
    "leg at a rail": ((-0.3, 0.31, 0.5), False),
    "beside the rails": ((-0.3, -0.46, 0.2), False),
}


@pytest.mark.parametrize("name", IN_DOCK)
def test_what_belongs_to_a_dock(name: str) -> None:
    (x, y, z), own = IN_DOCK[name]
    dock = Pose2(2.0, 1.0, 0.5)
    at = dock.compose(Pose2(x, y, 0.0))
    scene = Scene()
    scene.around.dock(dock, 0.0, scene.now_s)
    scene.see((at.x, at.y, z))
    assert (scene.known(docking=True) == []) is own
    assert len(scene.known(docking=False)) == 1


def test_the_dock_moves_with_the_world_and_grows_old() -> None:
    scene = Scene(Twist2(0.5, 0.0, 0.0)).go(0.5)
    scene.around.dock(Pose2(2.0, 0.0, 0.0), 0.1, scene.now_s)
    scene.see((1.95, 0.0, 0.5))  # 0.05 m driven since: on the board
    assert scene.known(docking=True) == []
    scene.go(0.1).see((1.87, 0.0, 0.5))  # the board is 1.90 m ahead now
    assert scene.known(docking=True) == [[1.87, 0.0, 0.5]]
    fresh = Scene()
    fresh.around.dock(Pose2(2.0, 0.0, 0.0), 0.0, fresh.now_s)
    fresh.see((2.0, 0.0, 0.5))
    assert fresh.around.points(True, 0.3, fresh.now_s + 0.29).size == 0
    assert fresh.around.points(True, 0.3, fresh.now_s + 0.31).size == 3
    assert fresh.around.points(True, 0.3, fresh.now_s - 0.01).size == 3


@pytest.mark.parametrize(
    ("pose", "latency_s"),
    [
        (Pose2(math.nan, 0.0, 0.0), 0.0),
        (Pose2(2.0, 0.0, 0.0), -0.01),
        (Pose2(2.0, 0.0, 0.0), 0.31),
        (Pose2(2.0, 0.0, 0.0), math.nan),
    ],
)
def test_a_dock_that_makes_no_sense_is_none(pose: Pose2, latency_s: float) -> None:
    scene = Scene().see((2.0, 0.0, 0.5))
    scene.around.dock(pose, latency_s, scene.now_s)
    assert len(scene.known(docking=True)) == 1


# --- parameters ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "shipped", "changes", "complaint"),
    [
        (CollisionParams, PARAMS.collision, {"approach_s": 3.0}, "stop_s, approach_s, near_s must grow"),
        (CollisionParams, PARAMS.collision, {"stop_s": 2.5}, "stop_s, approach_s, near_s must grow"),
        (CollisionParams, PARAMS.collision, {"margin_m": 0.15}, "margin_m, stop_clearance_m, near_clearance_m must"),
        (CollisionParams, PARAMS.collision, {"stop_clearance_m": 1.0}, "margin_m, stop_clearance_m, near_clearance_m"),
        (CollisionParams, PARAMS.collision, {"slowest_mps": 0.0}, "slowest_mps"),
        (CollisionParams, PARAMS.collision, {"stop_s": math.nan}, "stop_s"),
        (BlindParams, BLIND, {"lowest_ray_deg": 5.0}, "lowest_ray_deg"),
        (BlindParams, BLIND, {"sightings": 0}, "sightings"),
        (VolumeParams, OBSTACLES.exclusion.body, {"front_m": -0.02}, "rear_m must be less than front_m"),
        (VolumeParams, OBSTACLES.exclusion.body, {"inner_m": 0.45}, "inner_m less than outer_m"),
        (ExclusionParams, OBSTACLES.exclusion, {"rails": None}, "rails"),
        (LidarParams, PARAMS.lidar, {"min_range_m": 60.0}, "min_range_m must be less than max_range_m"),
        (LidarParams, PARAMS.lidar, {"sample": 10}, "sample"),
    ],
)
def test_parameters_that_make_no_sense(model: type, shipped: object, changes: dict[str, float], complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        model(**{**shipped.model_dump(), **changes})  # type: ignore[attr-defined]


def test_what_is_gone_beside_the_robot_where_its_rays_reach_is_forgotten() -> None:
    scene = Scene().keep_seeing(1.0, (0.2, 2.0, 0.1))
    assert [0.2, 2.0, 0.1] in scene.known()
    assert [0.2, 2.0, 0.1] not in scene.keep_seeing(1.0, (-3.0, 0.0, 1.0)).known()

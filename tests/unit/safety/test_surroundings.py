"""Storage of obstacle clouds, and the position of their points while the robot moves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from robot_stack.safety.collision import Outline
from robot_stack.safety.dead_reckoning import DeadReckoning
from robot_stack.safety.obstacle_params import CollisionParams, ExclusionParams, LidarParams, VolumeParams
from robot_stack.safety.surroundings import Surroundings
from tests.unit.safety.story import PARAMS

BODY = Outline(0.5, -0.5, 0.35)
NONE = np.empty((0, 3))
OBSTACLES = PARAMS.obstacles


class Scene:
    """A robot that drives with a constant twist and receives 20 clouds/s."""

    def __init__(self, twist: Twist2 | None = None) -> None:
        self.dead_reckoning = DeadReckoning(OBSTACLES.max_latency_s)
        self.around = Surroundings(OBSTACLES, self.dead_reckoning)
        self.twist = twist or Twist2(0.0, 0.0, 0.0)
        self.now_s = 10.0
        self.dead_reckoning.update(self.twist, self.now_s)

    def go(self, seconds: float) -> Scene:
        for _ in range(round(seconds / 0.05)):
            self.now_s += 0.05
            self.dead_reckoning.update(self.twist, self.now_s)
        return self

    def see(self, *points: tuple[float, float, float], latency_s: float = 0.0) -> Scene:
        self.around.received(cloud(*points), latency_s, BODY, self.now_s)
        return self

    def known(self, docking: bool = False) -> list[list[float]]:
        points = self.around.points(docking, 0.3, self.now_s)
        return sorted([round(float(value), 3) for value in point] for point in points)


def cloud(*points: tuple[float, float, float]) -> NDArray[np.float64]:
    return np.array(points, np.float64).reshape(-1, 3)


def moving(*rows: tuple[float, float, float, float, float]) -> NDArray[np.float64]:
    """(n, 5) x, y, z, vx, vy."""
    return np.array(rows, np.float64).reshape(-1, 5)


# --- clouds ----------------------------------------------------------------------------------------------------------


def test_never_received() -> None:
    scene = Scene()
    assert (scene.around.age_s(10.0), scene.around.problem) == (math.inf, "never received")
    assert scene.known() == []


def test_the_age_of_the_points_counts_from_their_time_and_not_from_their_reception() -> None:
    scene = Scene()
    assert scene.around.sight_age_s(scene.now_s) == math.inf
    scene.see((2.0, 0.0, 1.0), latency_s=0.1)
    assert scene.around.sight_age_s(scene.now_s) == pytest.approx(0.1)
    assert scene.around.age_s(scene.now_s) == 0.0
    assert scene.go(0.1).around.sight_age_s(scene.now_s) == pytest.approx(0.2)
    for latency_s in (-0.01, OBSTACLES.max_latency_s + 0.01, math.nan):
        scene.see((2.0, 0.0, 1.0), latency_s=latency_s)  # rejected
    assert scene.around.sight_age_s(scene.now_s) == pytest.approx(0.2)
    assert scene.around.sight_age_s(scene.now_s - 1.0) == math.inf
    assert scene.around.sight_age_s(math.nan) == math.inf
    assert scene.see(latency_s=0.05).around.sight_age_s(scene.now_s) == pytest.approx(0.05)  # an empty cloud


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


def test_a_cloud_of_just_the_window_s_age_belongs_to_the_picture() -> None:
    scene = Scene()
    scene.now_s = 0.0
    scene.see((3.0, 0.0, 1.0))
    scene.now_s = OBSTACLES.window_s
    assert scene.see((-3.0, 0.0, 1.0)).known() == [[-3.0, 0.0, 1.0], [3.0, 0.0, 1.0]]


def test_empty_cloud_is_fresh_without_obstacles() -> None:
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


def test_points_within_the_footprint_belong_to_the_robot() -> None:
    assert Scene().see((0.5, 0.0, 0.3), (0.0, -0.35, 0.3), (0.51, 0.0, 0.3)).known() == [[0.51, 0.0, 0.3]]


def test_of_a_column_the_nearest_point_is_kept_at_the_height_of_the_highest() -> None:
    column = [(2.04, 0.01, 0.2), (2.01, 0.01, 0.5), (2.02, 0.04, 1.5), (2.03, 0.02, 1.0)]
    assert Scene().see(*column, (2.06, 0.01, 0.1)).known() == [[2.01, 0.01, 1.5], [2.06, 0.01, 0.1]]
    behind = [(-2.01, -0.01, 0.5), (-2.04, -0.01, 0.7)]
    assert Scene().see(*behind).known() == [[-2.01, -0.01, 0.7]]


def test_the_nearest_of_a_column_beside_the_robot() -> None:
    assert Scene().see((0.01, 1.04, 0.2), (0.03, 1.01, 0.2)).known() == [[0.03, 1.01, 0.2]]
    assert Scene().see((0.01, -1.01, 0.2), (0.03, -1.04, 0.2)).known() == [[0.01, -1.01, 0.2]]
    assert Scene().see((1.01, 1.03, 0.2), (1.03, 1.01, 0.2)).known() == [[1.01, 1.03, 0.2]]  # first of equals


@pytest.mark.parametrize("y_m", [0.61, 1.11, -0.74, -0.14])
def test_columns_are_kept_separate(y_m: float) -> None:
    """Two points in each of 4 by 4 columns: one point per column is kept."""
    middles = [(2.0 + 0.05 * column, y_m + 0.05 * row) for column in range(4) for row in range(4)]
    pairs = [point for x, y in middles for point in ((x + 0.02, y, 0.1), (x + 0.01, y, 0.3))]
    assert Scene().see(*pairs).known() == sorted([round(x + 0.01, 3), round(y, 3), 0.3] for x, y in middles)


def test_low_precision_points_keep_the_precision_of_the_path() -> None:
    """Clouds are float32: far from the origin of dead reckoning this would lose a millimetre."""
    scene = Scene()
    scene.dead_reckoning.pose = Pose2(1e5, 0.0, 0.0)
    scene.around.received(cloud((2.001, 0.5, 1.0)).astype(np.float32), 0.0, BODY, scene.now_s)
    scene.around.unseen_received(cloud((2.001, 0.5, 1.0)).astype(np.float32), 0.0, scene.now_s)
    scene.around.moving_received(moving((2.001, 0.5, 1.0, 0.0, 0.0)).astype(np.float32), 0.0, scene.now_s)
    assert scene.known() == [[2.001, 0.5, 1.0]]
    assert scene.around.unseen(0.3, scene.now_s) == pytest.approx(np.array([[2.001, 0.5, 1.0]]), abs=1e-4)
    assert scene.around.moving(0.3, scene.now_s) == pytest.approx(np.array([[2.001, 0.5, 1.0, 0.0, 0.0]]), abs=1e-4)


def test_far_points_are_left_out() -> None:
    radius = OBSTACLES.radius_m
    assert len(Scene().see((radius, 0.0, 1.0)).known()) == 1
    assert len(Scene().see((0.6 * radius, 0.79 * radius, 1.0)).known()) == 1
    assert Scene().see((0.6 * radius, 0.81 * radius, 1.0)).known() == []


def test_time_running_backwards_restarts_the_window() -> None:
    scene = Scene().see((2.0, 0.0, 1.0))
    scene.now_s = 5.0
    assert scene.around.age_s(scene.now_s) == math.inf
    scene.see((3.0, 0.0, 1.0))
    assert scene.around.age_s(scene.now_s) == 0.0
    assert scene.known() == [[3.0, 0.0, 1.0]]


# --- the end of known space ------------------------------------------------------------------------------------------


def test_frontier_moves_with_the_robot_and_becomes_stale() -> None:
    scene = Scene(Twist2(1.0, 0.0, 0.0)).go(0.5)
    assert scene.around.unseen(0.3, scene.now_s) is None
    scene.around.unseen_received(cloud((2.0, 0.0, 0.0), (math.nan, 0.0, 0.0)), 0.1, scene.now_s)
    found = scene.around.unseen(0.3, scene.now_s)
    assert found is not None
    assert found == pytest.approx(np.array([[1.9, 0.0, 0.0]]))
    scene.go(0.2)
    found = scene.around.unseen(0.3, scene.now_s)
    assert found is not None
    assert found == pytest.approx(np.array([[1.7, 0.0, 0.0]]))
    assert scene.around.unseen(0.3, scene.now_s + 0.11) is None
    assert scene.around.unseen(0.3, scene.now_s - 1.0) is None


def test_ground_boundary_moves_with_the_robot_and_becomes_stale() -> None:
    scene = Scene(Twist2(1.0, 0.0, 0.0)).go(0.5)
    assert scene.around.no_ground(0.3, scene.now_s) is None
    scene.around.no_ground_received(cloud((2.0, 0.0, 0.0), (math.nan, 0.0, 0.0)), 0.1, scene.now_s)
    scene.around.no_ground_received(cloud((math.nan, 0.0, 0.0)), 0.0, scene.now_s)
    scene.around.no_ground_received(cloud((1.0, 0.0, 0.0)), OBSTACLES.max_latency_s + 0.01, scene.now_s)
    scene.go(0.2)
    found = scene.around.no_ground(0.3, scene.now_s)
    assert found is not None
    assert found == pytest.approx(np.array([[1.7, 0.0, 0.0]]))
    assert scene.around.unseen(0.3, scene.now_s) is None
    assert scene.around.no_ground(0.3, scene.now_s + 0.11) is None


@pytest.mark.parametrize("latency_s", [OBSTACLES.max_latency_s + 0.01, -0.01, math.nan])
def test_invalid_frontier_is_rejected(latency_s: float) -> None:
    scene = Scene()
    scene.around.unseen_received(cloud((2.0, 0.0, 0.0)), latency_s, scene.now_s)
    scene.around.unseen_received(cloud((math.nan, 0.0, 0.0)), 0.0, scene.now_s)
    assert scene.around.unseen(0.3, scene.now_s) is None
    scene.around.unseen_received(cloud(), 0.0, scene.now_s)
    found = scene.around.unseen(0.3, scene.now_s)
    assert found is not None
    assert len(found) == 0
    assert scene.around.problem == "never received"  # of the obstacles, which are separate


# --- moving objects --------------------------------------------------------------------------------------------------


def test_moving_objects_are_extrapolated_while_the_robot_moves() -> None:
    scene = Scene(Twist2(1.0, 0.0, 0.0)).go(0.5)
    assert scene.around.moving(0.3, scene.now_s) is None
    rows = moving((2.0, 1.0, 0.5, -0.5, -2.0), (2.0, 1.0, 0.5, math.nan, 0.0), (math.inf, 1.0, 0.5, 0.0, 0.0))
    scene.around.moving_received(rows, 0.1, scene.now_s)
    found = scene.around.moving(0.3, scene.now_s)
    assert found is not None
    assert found == pytest.approx(np.array([[1.85, 0.8, 0.5, -0.5, -2.0]]))
    scene.go(0.2)
    assert scene.around.moving(0.3, scene.now_s) == pytest.approx(np.array([[1.55, 0.4, 0.5, -0.5, -2.0]]))
    assert scene.around.moving(0.3, scene.now_s + 0.11) is None
    assert scene.around.moving(0.3, scene.now_s - 1.0) is None


def test_moving_objects_are_rotated_with_the_robot() -> None:
    scene = Scene()
    scene.dead_reckoning.pose = Pose2(0.0, 0.0, math.pi / 2)
    scene.around.moving_received(moving((2.0, 0.0, 0.5, 0.0, 1.0)), 0.0, scene.now_s)
    scene.dead_reckoning.pose = IDENTITY
    assert scene.around.moving(0.3, scene.now_s) == pytest.approx(np.array([[0.0, 2.0, 0.5, -1.0, 0.0]]), abs=1e-9)


@pytest.mark.parametrize("latency_s", [OBSTACLES.max_latency_s + 0.01, -0.01, math.nan])
def test_a_motion_that_makes_no_sense_is_not_received(latency_s: float) -> None:
    scene = Scene()
    scene.around.moving_received(moving((2.0, 0.0, 0.5, 0.0, 1.0)), latency_s, scene.now_s)
    scene.around.moving_received(moving((2.0, 0.0, 0.5, 0.0, math.nan)), 0.0, scene.now_s)
    assert scene.around.moving(0.3, scene.now_s) is None
    scene.around.moving_received(moving(), 0.0, scene.now_s)
    found = scene.around.moving(0.3, scene.now_s)
    assert found is not None
    assert found.shape == (0, 5)
    assert scene.around.problem == "never received"  # of the obstacles, which are separate


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
ON_THE_EDGE = [
    (0.8, 0.0, 0.5),
    (0.3, 0.45, 0.5),
    (0.3, -0.45, 0.5),
    (0.6, 0.0, 1.6),
    (-0.02, 0.4, 0.5),
    (0.0, 0.4, 0.3),
]


@pytest.mark.parametrize("name", IN_DOCK)
def test_points_that_belong_to_a_dock(name: str) -> None:
    (x, y, z), own = IN_DOCK[name]
    dock = Pose2(2.0, 1.0, 0.5)
    at = dock.compose(Pose2(x, y, 0.0))
    scene = Scene()
    scene.around.dock(dock, 0.0, scene.now_s)
    scene.see((at.x, at.y, z))
    assert (scene.known(docking=True) == []) is own
    assert len(scene.known(docking=False)) == 1


@pytest.mark.parametrize("point", ON_THE_EDGE)
def test_a_dock_s_edge_is_the_dock_s(point: tuple[float, float, float]) -> None:
    scene = Scene()
    scene.around.dock(IDENTITY, 0.0, scene.now_s)
    assert scene.see(point).known(docking=True) == []
    assert len(scene.known(docking=False)) == 1


def test_age_limits_apply_to_each_input() -> None:
    scene = Scene()
    scene.now_s = 0.0
    scene.around.dock(IDENTITY, OBSTACLES.max_latency_s, scene.now_s)
    scene.around.unseen_received(cloud((2.0, 0.0, 0.0)), OBSTACLES.max_latency_s, scene.now_s)
    scene.around.moving_received(moving((2.0, 0.0, 0.0, 1.0, 0.0)), OBSTACLES.max_latency_s, scene.now_s)
    scene.see((0.6, 0.0, 0.5))
    scene.now_s = 0.3
    assert scene.known(docking=True) == []
    assert scene.around.unseen(0.3, scene.now_s) is not None
    assert scene.around.moving(0.3, scene.now_s) is not None


def test_the_dock_moves_with_the_world_and_grows_old() -> None:
    scene = Scene(Twist2(0.5, 0.0, 0.0)).go(0.5)
    scene.around.dock(Pose2(2.0, 0.0, 0.0), 0.1, scene.now_s)
    scene.see((1.95, 0.0, 0.5))  # 0.05 m driven since the measurement: on the board
    assert scene.known(docking=True) == []
    scene.go(0.1).see((1.87, 0.0, 0.5))  # the board is now 1.90 m ahead
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
        (CollisionParams, PARAMS.collision, {"unseen_mps": 0.0}, "unseen_mps"),
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

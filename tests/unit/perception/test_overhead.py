"""The overhead LiDAR: frames of the simulated sensor, partly blocked by robot, wheelchair and passenger."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from robot_stack.contract import frames
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2, exp_se2
from robot_stack.core.point_cloud import Points
from robot_stack.core.robot import Robot, load_robot
from robot_stack.core.robot_shape import load_robot_shape, planar
from robot_stack.perception.crop import beside_mast
from robot_stack.perception.deskew import LEVEL, Motion
from robot_stack.perception.overhead import Overhead
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from sim.camera.motion import still
from sim.lidar.bodies import robot_shapes
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import WHEELCHAIR, build_scene
from sim.lidar.sensor import Lidar
from sim.lidar.views import moving
from sim.params import load_sim_params
from sim.worldfile import WorldFile, load_world
from tests.unit.perception.scenes import sweep
from tests.unit.sim.lidar.scenes import world

LATCHED = load_docks().latched_wheelchair()
FLAT = world()
SENSOR = frames.OVERHEAD_LIDAR


def frame(
    place: WorldFile = FLAT,
    base: Pose2 = IDENTITY,
    people: Sequence[Pose2] = (),
    *,
    chair: bool = False,
    twist: Twist2 = ZERO_TWIST,
    seed: int = 3,
) -> Points:
    """people: in base_link. chair: latched, with its passenger."""
    params, robot = load_lidar_params(SENSOR), load_robot()
    names = [f"person_{index}" for index in range(len(people))]
    movers = {name: still(planar(base.compose(pose))) for name, pose in zip(names, people, strict=True)}
    if chair:
        assert LATCHED is not None
        movers[WHEELCHAIR] = still(planar(base.compose(LATCHED)))
    own = robot_shapes(robot, load_robot_shape())
    scene = build_scene(place, params, load_sim_params().wheelchair, people=names, own=own)
    lidar = Lidar(scene, params, robot, seed, SENSOR)
    return lidar.sweep(moving(planar(base), twist, params.beams.period_s), 0.0, movers).points


def odometry(motion: Motion, twist: Twist2 = ZERO_TWIST) -> None:
    for index in range(-20, 21):
        stamp_s = 0.02 * index
        motion.on_odometry(stamp_s, exp_se2(twist, stamp_s), twist)
        motion.on_attitude(stamp_s, LEVEL)


def seen(points: Points, robot: Robot, params: PerceptionParams, chair: bool = False, **at: Any) -> np.ndarray:
    """Returns the obstacles of one frame, (n, 3) base_link."""
    motion = Motion(params.deskew)
    odometry(motion, **at)
    overhead = Overhead(robot, params, motion)
    overhead.take(points, 0.0, chair)
    return overhead.at(0.0)


def near(xyz: np.ndarray, x: float, y: float, within_m: float = 0.45) -> int:
    return int((np.hypot(xyz[:, 0] - x, xyz[:, 1] - y) < within_m).sum())


@pytest.mark.parametrize("chair", [False, True])
@pytest.mark.parametrize("twist", [ZERO_TWIST, Twist2(1.0, 0.0, 0.0), Twist2(0.3, 0.0, 1.0)])
def test_even_ground_robot_mast_and_passenger_are_no_obstacles(
    chair: bool, twist: Twist2, robot: Robot, params: PerceptionParams
) -> None:
    assert len(seen(frame(chair=chair, twist=Twist2(0, 0, 0)), robot, params, chair)) == 0
    if not chair:  # an attached chair would have to move too
        assert len(seen(frame(twist=twist), robot, params, twist=twist)) == 0


def test_ranges_between_the_edges_of_mast_and_passenger_and_the_ground_are_no_obstacles(
    robot: Robot, params: PerceptionParams
) -> None:
    """Some beams at an edge report a range in between; behind the mast every tenth frame had such obstacles."""
    for seed in range(25):
        found = seen(frame(base=Pose2(0.3 * seed, 0.0, 0.1 * seed), chair=True, seed=seed), robot, params, chair=True)
        assert len(found) == 0, (seed, found)


@pytest.mark.parametrize(
    ("point", "hidden"),
    [
        ((-1.5, 0.0), True),
        ((-0.43, 0.0), True),
        ((-0.40, 0.0), False),  # in front of it
        ((-1.5, 0.06), True),  # 1.95 m away: 0.045 m of shadow, and 0.04 m of margin
        ((-1.5, -0.10), False),
        ((1.5, 0.0), False),
    ],
)
def test_points_behind_the_mast(robot: Robot, point: tuple[float, float], hidden: bool) -> None:
    xyz = np.array([[*point, 0.5]], np.float32)
    assert beside_mast(xyz, (0.45, 0.0), robot.mast, 0.02)[0] == hidden


def test_sensor_on_top_of_its_mast_has_no_shadow(robot: Robot) -> None:
    around = np.array([[1.0, 0.0, 0.5], [-1.0, 0.0, 0.5]], np.float32)
    assert not beside_mast(around, (robot.mast.x_m, robot.mast.y_m), robot.mast, 0.02).any()


@pytest.mark.parametrize("ahead_m", [1.75, 2.0, 2.5, 3.5])
@pytest.mark.parametrize("aside_m", [-0.4, 0.0, 0.4])
def test_a_person_before_the_passenger_is_seen(
    ahead_m: float, aside_m: float, robot: Robot, params: PerceptionParams
) -> None:
    """With a wheelchair the LiDAR on the deck does not see 25 deg to either side of straight ahead."""
    points = frame(people=[Pose2(ahead_m, aside_m, 0.0)], chair=True)
    assert near(seen(points, robot, params, chair=True), ahead_m, aside_m) > 50


def test_only_the_view_for_fast_bodies_has_returns_from_afar(robot: Robot, params: PerceptionParams) -> None:
    """Sparse returns of a cart 6 m ahead seemed to move towards the path and stopped the robot."""
    motion = Motion(params.deskew)
    odometry(motion)
    overhead = Overhead(robot, params, motion)
    wide = overhead.take(frame(people=[Pose2(7.0, 0.0, 0.0), Pose2(2.5, 1.0, 0.0)]), 0.0, False)
    first = overhead.near(wide)
    assert near(wide.hits, 7.0, 0.0) > 10
    assert near(first.hits, 7.0, 0.0) == 0
    assert near(first.hits, 2.5, 1.0) == near(wide.hits, 2.5, 1.0) > 10
    assert np.hypot(first.hits[:, 0], first.hits[:, 1]).max() <= params.overhead.range_m
    assert first.passed_m.shape == first.ground_m.shape == first.bare.shape < wide.passed_m.shape


@pytest.mark.parametrize("front_m", [2.0, 2.5, 2.7])
@pytest.mark.parametrize("length_m", [0.5, 0.9, 1.4])
def test_low_box_in_the_shadow_of_the_chair_is_an_obstacle(
    front_m: float, length_m: float, robot: Robot, params: PerceptionParams
) -> None:
    """Its top is the first surface seen there, smooth like a deck and within the slope of a ramp from the wheels."""
    x_m = front_m + 0.5 * length_m
    box = {"name": "box", "x_m": x_m, "y_m": 0.0, "length_m": length_m, "width_m": 0.5, "height_m": 0.25}
    found = seen(frame(world(boxes=[box]), chair=True), robot, params, chair=True)
    shown = (found[:, 0] > 2.8) & (found[:, 0] < x_m + 0.5 * length_m + 0.1) & (np.abs(found[:, 1]) < 0.3)
    assert shown.any() == (front_m + length_m > 2.95)  # nearer, rays pass above it


@pytest.mark.parametrize("edge_m", [-0.45, 0.45])
@pytest.mark.parametrize("foot_m", [1.5, 2.0, 2.5])
@pytest.mark.parametrize("yaw", [0.0, 0.06])
def test_ramp_with_one_edge_near_the_robot_is_ground_behind_the_chair(
    edge_m: float, foot_m: float, yaw: float, robot: Robot, params: PerceptionParams
) -> None:
    """The robot drives up to it turned towards the edge, beyond which the level ground goes on."""
    ramp = {"name": "ramp", "x_m": foot_m, "y_m": edge_m - math.copysign(2.0, edge_m), "slope_deg": 10.0,
            "height_m": 0.6, "width_m": 4.0, "top_length_m": 3.0}  # fmt: skip
    base = Pose2(0.0, 0.0, math.copysign(yaw, edge_m))
    found = seen(frame(world(ramps=[ramp]), base, chair=True), robot, params, chair=True)
    aside_m = math.copysign(1.0, edge_m) * (math.sin(base.yaw) * found[:, 0] + math.cos(base.yaw) * found[:, 1])
    assert not ((found[:, 0] > 1.4) & (aside_m < abs(edge_m) - 0.15)).any(), found


@pytest.mark.parametrize(("x_m", "y_m"), [(-2.0, 0.25), (-1.2, 0.0), (-0.9, 0.0)])
def test_a_bag_behind_the_deck_is_seen(x_m: float, y_m: float, robot: Robot, params: PerceptionParams) -> None:
    """0.2 m wide and 0.3 m high, hidden by the deck from the other LiDAR. Far behind, the mast's shadow is as wide."""
    bag = {"name": "bag", "x_m": x_m, "y_m": y_m, "length_m": 0.2, "width_m": 0.2, "height_m": 0.3}
    assert near(seen(frame(world(boxes=[bag])), robot, params), x_m, y_m, 0.25) >= params.obstacles.neighbours_min


@pytest.mark.parametrize(("y_m", "name"), [(0.0, "5 deg"), (4.5, "10 deg")])
@pytest.mark.parametrize("x_m", [1.0, 2.0])
def test_a_ramp_ahead_is_ground(y_m: float, name: str, x_m: float, robot: Robot, params: PerceptionParams) -> None:
    """Between its sides, which are walls."""
    found = seen(frame(load_world("ramps"), Pose2(x_m, y_m, 0.0)), robot, params)
    assert not ((np.abs(found[:, 1]) < 1.2) & (found[:, 0] > 0.5)).any(), name


def test_frame_moves_with_the_robot_and_expires(robot: Robot, params: PerceptionParams) -> None:
    twist = Twist2(1.0, 0.0, 0.5)
    motion = Motion(params.deskew)
    odometry(motion, twist)
    overhead = Overhead(robot, params, motion)
    overhead.take(frame(people=[Pose2(3.0, 0.5, 0.0)], twist=twist), 0.0, False)
    now, later = overhead.at(0.0), overhead.at(0.2)
    assert near(now, 3.0, 0.5) > 50
    there = Pose2(3.0, 0.5, 0.0).relative_to(exp_se2(twist, 0.2))
    assert near(later, there.x, there.y) == near(now, 3.0, 0.5)
    assert len(overhead.at(params.overhead.keep_s + 0.01)) == 0
    assert len(overhead.at(math.nan)) == 0
    overhead.forget()
    assert len(overhead.at(0.0)) == 0


def test_it_joins_the_obstacles(pipeline: Pipeline) -> None:
    odometry(pipeline.motion)
    pipeline.chair = True
    before = pipeline.scene(sweep(), 0.0)
    assert near(before.obstacles, 2.0, 0.0) == 0
    pipeline.overhead(frame(people=[Pose2(2.0, 0.0, 0.0)], chair=True), 0.05)
    after = pipeline.scene(sweep(seed=1), 0.05)
    assert near(after.obstacles, 2.0, 0.0) > 50
    pipeline.forget()
    assert near(pipeline.scene(sweep(seed=2), 0.1).obstacles, 2.0, 0.0) == 0


def test_robot_without_overhead_lidar_is_supported(robot: Robot, params: PerceptionParams) -> None:
    lidar = {frames.LIDAR: robot.range_sensors[frames.LIDAR]}
    pipeline = Pipeline(robot.model_copy(update={"range_sensors": lidar}), params)
    odometry(pipeline.motion)
    pipeline.overhead(frame(), 0.0)
    assert len(pipeline.scene(sweep(), 0.0).obstacles) == 0


def test_geometry_derived_from_a_mounting(robot: Robot) -> None:
    """Where the rings meet the ground: 0.7 m / tan(30 deg), and 1.9 m / tan(52 deg) for the upside-down sensor."""
    lidar, overhead = robot.range_sensors[frames.LIDAR], robot.range_sensors[SENSOR]
    assert lidar.first_ground_m() == pytest.approx(0.70 / math.tan(math.radians(30.0)))
    assert overhead.first_ground_m() == pytest.approx(1.90 / math.tan(math.radians(52.0)), rel=1e-3)
    assert lidar.ring_spacing_rad == pytest.approx(math.radians(45.0) / 63)
    tilted = overhead.model_copy(update={"rpy_deg": (180.0, 15.0, 0.0)})
    assert tilted.first_ground_m() > overhead.first_ground_m() + 0.5
    level = lidar.model_copy(update={"lowest_deg": 0.0})
    assert level.first_ground_m() == math.inf
    assert lidar.highest_slope() == pytest.approx(math.tan(math.radians(15.0)))
    assert overhead.highest_slope() == pytest.approx(math.tan(math.radians(7.0)))
    assert tilted.highest_slope() < overhead.highest_slope()


def test_a_few_returns_between_the_chair_and_the_ground_behind_it_are_no_obstacle(
    robot: Robot, params: PerceptionParams
) -> None:
    """Beams on chair and passenger return a range in between, as if 0.5 m above the ground: four of them, and eight."""
    chair, ground = frame(chair=True), frame()
    chair_m, ground_m = (np.linalg.norm([points[axis] for axis in "xyz"], axis=0) for points in (chair, ground))
    share = 1.0 - 0.5 / robot.range_sensors[SENSOR].xyz_m[2]
    beams = np.flatnonzero(chair_m < share * ground_m - 0.2)
    between = share * np.stack([ground[axis][beams] for axis in "xyz"], axis=1)
    assert len(beams) > 300
    for middle in between[::60]:
        nearest = np.argsort(np.linalg.norm(between - middle, axis=1))
        for count, seen_at_all in ((4, False), (8, True)):
            mixed = chair.copy()
            for axis, values in zip("xyz", between[nearest[:count]].T, strict=True):
                mixed[axis][beams[nearest[:count]]] = values
            assert (len(seen(mixed, robot, params, chair=True)) > 0) == seen_at_all, (middle, count)

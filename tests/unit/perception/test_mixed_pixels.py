"""Beams at the edge of the attached chair return a range between it and the background, where no object is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robot_stack.contract import frames
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import ZERO_TWIST, Pose2
from robot_stack.core.point_cloud import SWEEP
from robot_stack.core.robot import Robot, load_robot
from robot_stack.core.robot_shape import load_robot_shape, planar
from robot_stack.perception.deskew import LEVEL, Attitude
from robot_stack.perception.mixed_pixels import ChairEdges
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from robot_stack.perception.space.view import view_of_beams
from sim.camera.motion import still
from sim.lidar.bodies import robot_shapes
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import WHEELCHAIR, build_scene
from sim.lidar.sensor import Lidar
from sim.lidar.views import moving
from sim.params import load_sim_params
from sim.worldfile import load_world
from tests.unit.space.yard import CHILD, POLE, Block, Post, Yard, near

LOW_BOX, STUMP = Post(0.15, 0.30), Post(0.05, 0.20)
CLEARANCE_M = 0.16  # slightly above the stopping distance


def site_lidar(sensor: str, seed: int) -> Lidar:
    robot, params = load_robot(), load_lidar_params(sensor)
    own = robot_shapes(robot, load_robot_shape()) if sensor == frames.OVERHEAD_LIDAR else []
    scene = build_scene(load_world("yard"), params, load_sim_params().wheelchair, own=own)
    return Lidar(scene, params, robot, seed, sensor)


@pytest.mark.parametrize(
    "pose",
    [Pose2(-1.61, 11.54, 2.29), Pose2(-1.57, 11.85, 2.02), Pose2(-2.01, 11.54, 2.52), Pose2(2.63, 12.99, 0.07)],
)
def test_a_ride_with_the_chair_is_not_stopped_by_what_is_not_there(
    pose: Pose2, robot: Robot, params: PerceptionParams
) -> None:
    """Poses in the demonstration where such points stopped the robot in about one of ten sweeps."""
    lidar, overhead = site_lidar(frames.LIDAR, 3), site_lidar(frames.OVERHEAD_LIDAR, 4)
    latched = load_docks().latched_wheelchair()
    assert latched is not None
    base, movers = moving(planar(pose), ZERO_TWIST, 0.1), {WHEELCHAIR: still(planar(pose.compose(latched)))}
    pipeline = Pipeline(robot, params)
    pipeline.chair = True
    footprint = robot.footprint_with_chair
    for step in range(40):
        stamp_s = 10.0 + 0.05 * step
        pipeline.motion.on_odometry(stamp_s, pose, ZERO_TWIST)
        if step % 2:
            pipeline.overhead(overhead.sweep(base, 0.0, movers).points, stamp_s)
        found = pipeline.scene(lidar.half_sweep(base, 0.0, step % 2, movers).points, stamp_s).obstacles
        x, y = found[:, 0], np.abs(found[:, 1])
        close = (x < footprint.front_m + CLEARANCE_M) & (x > footprint.rear_m - CLEARANCE_M)
        assert not (close & (y < 0.5 * footprint.width_m + CLEARANCE_M)).any(), (step, found[close])


def test_returns_between_the_chair_and_a_wall_before_it_are_no_obstacles() -> None:
    wall = Block(0.05, 1.5, 0.0, 1.5)
    yard = Yard(chair=True, mixed=0.3, overhead=False, columns=load_lidar_params().beams.columns, wall=wall)
    yard.at["wall"] = (2.2, 0.0)
    for _ in range(4):
        x, y, _ = yard.step().obstacles.T
        assert not ((x > 0.0) & (x < 2.05) & (np.abs(y) < 1.4)).any()


@pytest.mark.parametrize(
    ("who", "x_m"),
    [(who, x_m) for who in (CHILD, POLE, LOW_BOX, STUMP) for x_m in (1.2, 1.6, 2.0, 2.6) if (who, x_m) != (STUMP, 2.6)],
)
@pytest.mark.parametrize("y_m", [0.50, 0.60, 0.70, -0.60])
def test_object_beside_the_chairs_edge_is_an_obstacle(who: Post, x_m: float, y_m: float) -> None:
    yard = Yard(chair=True, mixed=0.3, columns=load_lidar_params().beams.columns, who=who)
    away_m = max(abs(y_m), 0.45 + who.radius_m)
    yard.at["who"] = (x_m, np.copysign(away_m, y_m))
    yard.run(0.3)
    assert yard.scene is not None
    assert near(yard.scene.obstacles, x_m, float(np.copysign(away_m, y_m)), who.radius_m + 0.1) > 0


def test_few_points_beside_the_chair_are_no_obstacle_and_many_are(params: PerceptionParams) -> None:
    few = params.mixed_pixels
    box = np.array([0.45, 1.45, -0.45, 0.45, -0.3, 1.6], np.float32)
    chair = np.zeros(3, SWEEP)
    chair["x"], chair["y"], chair["z"] = [0.8, 0.8, np.nan], [0.3, 0.31, 0.0], [0.1, 0.1, 0.1]
    edges = ChairEdges(np.array([0.2, 0.0, 0.7], np.float32), None, box, (np.pi, np.radians(1.0)))
    edges.look(chair)
    behind = np.array([0.2 + 2 * 0.8, 2 * 0.3, 0.5], np.float32)
    for count, kept in ((few.points_min - 1, 0), (few.points_min, few.points_min)):
        assert len(edges.without_sparse(np.tile(behind, (count, 1)), few, few.points_min)) == kept
    reach_m = float(box[1]) + few.beyond_m
    for elsewhere in ((1.6, -0.6, 0.5), (reach_m + 0.4, (reach_m + 0.2) * 0.3 / 0.8, 0.5)):
        assert len(edges.without_sparse(np.array([elsewhere], np.float32), few, few.points_min)) == 1
    edges.look(chair[2:])
    assert len(edges.without_sparse(behind[None], few, few.points_min)) == 1


@pytest.mark.parametrize("attitude", [LEVEL, Attitude(0.05, 0.17), Attitude(-0.05, -0.17)])
def test_ground_beside_the_chair_is_no_ground_however_the_robot_is_tilted(attitude: Attitude) -> None:
    """On a ramp a beam that mixed the passenger's knees with the ground raised the ground by 0.18 m: an edge."""
    mount = np.array([0.2, 0.0, 1.9], np.float32)
    box = np.array([0.45, 1.45, -0.45, 0.45, -0.3, 1.6], np.float32)
    edges = ChairEdges(mount, None, box, (np.radians(1.4), np.radians(0.7)))
    knees, chair = np.array([1.42, 0.1, 0.6], np.float32), np.zeros(1, SWEEP)
    chair["x"], chair["y"], chair["z"] = (knees - mount)[:, None]
    edges.look(chair)
    mixed, clear = mount + 1.3 * (knees - mount), mount + 1.3 * (knees - mount) + np.array([0.6, 0.0, 0.0], np.float32)
    level = attitude.matrix()
    floor = np.ones((2, 4), np.float32)
    floor[:, :3] = np.stack([mixed, clear]) @ level.T
    view = view_of_beams(0.0, (0.2, 0.0, 1.9), np.empty((0, 3), np.float32), *(np.zeros(0, np.bool_),) * 2, 3.0)
    view = replace(view, floor=floor, tilt=(float(level[2, 0]), float(level[2, 1])))
    np.testing.assert_array_equal(edges.without(view).floor, floor[1:])


def test_a_chair_that_leans_is_found_where_it_leans_to() -> None:
    mount, hinge_m = np.array([0.2, 0.0, 1.9], np.float32), 0.17
    box = np.array([0.45, 1.45, -0.45, 0.45, -0.3, 1.6], np.float32)
    edges = ChairEdges(mount, None, box, (np.radians(1.4), np.radians(0.7)))
    head, chair = np.array([[1.5, 0.0, 1.2]], np.float32), np.zeros(1, SWEEP)
    chair["x"], chair["y"], chair["z"] = (head - mount).T
    edges.look(chair)
    assert not edges.beside(head).any()
    edges.look(chair, np.array([0.17, hinge_m], np.float32))
    assert edges.beside(head).all()


@pytest.mark.parametrize("bearing_deg", [0.5, 89.5, 179.5, -179.5])
def test_directions_right_beside_a_return_of_the_chair_are_its_edge(bearing_deg: float) -> None:
    """The eight around it, also across the sensor's back; none two steps away. Points off the chair's box mark none."""
    box = np.array([-1.1, 1.1, -1.1, 1.1, -0.5, 0.5], np.float32)
    edges = ChairEdges(np.zeros(3, np.float32), None, box, (np.radians(1.0), np.radians(1.0)))

    def at(azimuth_deg: float, elevation_deg: float, range_m: float) -> tuple[float, float, float]:
        azimuth, up = np.radians(azimuth_deg), np.radians(elevation_deg)
        return (
            range_m * np.cos(up) * np.cos(azimuth),
            range_m * np.cos(up) * np.sin(azimuth),
            range_m * np.sin(up),
        )

    points = np.zeros(2, SWEEP)
    for point, xyz in zip(points, (at(bearing_deg, 0.5, 1.0), at(bearing_deg + 20.0, 0.5, 3.0)), strict=True):
        point["x"], point["y"], point["z"] = xyz
    edges.look(points)
    steps = [(across, up) for across in range(-2, 3) for up in range(-2, 3)]
    around = [at(bearing_deg + across, 0.5 + up, 4.0) for across, up in steps]
    found = edges.beside(np.array([*around, at(bearing_deg + 20.0, 0.5, 4.0)], np.float32))
    assert found.tolist() == [*(abs(across) <= 1 and abs(up) <= 1 for across, up in steps), False]

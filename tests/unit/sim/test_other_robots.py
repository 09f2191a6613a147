"""Robots of three sizes with three LiDAR mountings: only config/robot.yaml differs.

On the deterministic scheduler, with the nodes of drive, localization, navigation and docking.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from robot_stack.contract import topics
from robot_stack.core.config import ConfigError, config_dir, load, read_yaml
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.core.point_cloud import xyz_of
from robot_stack.core.robot import Robot, load_robot
from robot_stack.core.site_map import load_map
from robot_stack.localization.ndt.matcher import pose_of
from robot_stack.localization.ndt.solver import MatchRequest, SweepSolver
from robot_stack.localization.params import LocalizationParams
from robot_stack.middleware.conversions import pose_from_msg
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from robot_stack.wmx.robot_parameters import robot_parameters
from sim.camera.motion import still
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import build_scene
from sim.lidar.sensor import Lidar, Sweep
from sim.params import load_sim_params
from sim.worldfile import Box, WorldFile, load_world
from tests.benchmarks.docking import Trial, dock
from tests.benchmarks.tracking import TrackedRide
from tests.support.robots import SIZES

SHIPPED = load_robot()
COLUMNS = 900
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(params=list(SIZES))
def size(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Makes the configuration that of a robot of this size."""
    name: str = request.param
    shipped, own = config_dir(), SIZES[name].write(tmp_path)
    monkeypatch.setenv("ROBOT_STACK_CONFIG", str(own))
    yield name
    files = [path.relative_to(shipped) for path in shipped.rglob("*") if path.is_file()]
    changed = [str(file) for file in files if (shipped / file).read_bytes() != (own / file).read_bytes()]
    assert changed == ["robot.yaml"]


def sweep_of(robot: Robot, world: WorldFile, at: Pose2 = IDENTITY) -> Sweep:
    """Returns the published sweep of the robot's LiDAR at rest, with fewer columns."""
    params = load_lidar_params().with_columns(COLUMNS)
    scene = build_scene(world, params, load_sim_params().wheelchair)
    return Lidar(scene, params, robot, seed=3).sweep(still(pose_of(at, 0.0, UP)), 0.0)


def drive_to_a_goal() -> None:
    """Odometry measures with the robot's own wheels."""
    with TrackedRide(1) as stack:
        odometry: list[Any] = []
        stack.test_tool.subscribe(topics.ODOM, odometry.append)
        goal = Pose2(1.6, 0.7, 0.8)
        stack.go(goal)
        assert stack.scheduler.run_for(20.0, lambda: stack.samples[-1].output.reached)
        pose, _ = stack.truth()
        assert pose.distance_to(goal) < 0.05
        assert abs(pose.relative_to(goal).yaw) < math.radians(2.0)
        assert pose_from_msg(odometry[-1].pose.pose).distance_to(pose) < 0.02


@pytest.mark.parametrize("size", ["large"], indirect=True)
def test_it_drives_to_a_goal(size: str) -> None:
    front, rear = load_robot().modules["fl"], load_robot().modules["rl"]
    assert (rear.x_m, rear.y_m) == pytest.approx((-0.85 * front.x_m, 0.75 * front.y_m))
    drive_to_a_goal()


def test_robot_with_other_motors_drives_to_a_goal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Motors with gears, on other axes of the engine, the right side mounted the other way, encoders with a zero.

    The motors turn as they are wired, whatever the engine assumes: only the imported parameters make them fit.
    """
    folder = tmp_path / "config"
    shutil.copytree(config_dir(), folder)
    robot = read_yaml(folder / "robot.yaml")
    robot["drive"] |= {"encoder_counts_per_rev": 8192, "gear_numerator": 25.0, "gear_denominator": 2.0}
    robot["steer"] |= {"gear_numerator": 9.0}
    for place, axis in enumerate(robot["axes"].values()):
        axis["number"] = 9 - place
    for name in ("fr_drive", "fr_steer", "rr_drive"):
        robot["axes"][name]["polarity"] = -1
    robot["axes"]["fr_steer"]["zero_rad"] = 0.4
    robot["axes"]["rl_steer"]["zero_rad"] = -1.1
    (folder / "robot.yaml").write_text(yaml.safe_dump(robot), encoding="utf-8")
    monkeypatch.setenv("ROBOT_STACK_CONFIG", str(folder))
    drive_to_a_goal()


@pytest.mark.timeout(900)  # two dockings, the first of which teaches
@pytest.mark.parametrize("size", ["large"], indirect=True)
def test_it_docks(size: str) -> None:
    """The middle one has the shipped dimensions, with which tests/unit/docking/test_docking_jobs.py docks."""
    trial = Trial(
        seed=5,
        start=Pose2(0.15, -0.12, math.radians(4.0)),
        chair=Pose2(0.0, 0.0, math.radians(-2.0)),
        slope_rad=0.0,
        slope_direction_rad=0.0,
        passenger_kg=70.0,
        weather="clear",
        taught=True,
    )
    outcome = dock(trial)
    assert outcome.success, outcome.reason
    assert outcome.error_mm < 2.0
    assert outcome.yaw_deg < 0.3


def test_lidar_of_other_robot_detects_level_ground_and_box(size: str) -> None:
    flat, robot = load_world("flat"), load_robot()
    box = Box(name="box", x_m=2.6, y_m=0.9, length_m=0.4, width_m=0.4, height_m=0.5)
    world = flat.model_copy(update={"boxes": (box,)})
    pipeline = Pipeline(robot, load(PerceptionParams, "perception_pipeline"))
    found = pipeline.scene(sweep_of(robot, world).points, 0.0).obstacles
    beside = np.maximum(np.abs(found[:, 0] - 2.6), np.abs(found[:, 1] - 0.9))
    assert (beside < 0.3).sum() > 10
    assert (beside >= 0.3).sum() == 0, "nothing else is there"
    pipeline.forget()
    xyz, _ = pipeline.points(sweep_of(robot, flat).points, 0.0)
    free_m = pipeline.segment(xyz).profile.free_m
    assert free_m.min() > 8.0
    assert np.median(free_m) > 15.0
    # Beams leave as mounted, points arrive in base_link's axes: level ground is level.
    xyz = xyz_of(sweep_of(robot, flat).points)
    assert abs(float(np.median(xyz[:, 2])) + robot.lidar_xyz_m[2]) < 0.02
    turned = Rotation.from_euler("xyz", SIZES[size].lidar_deg, degrees=True).as_matrix()
    assert robot.to_sensor_frame("lidar") == pytest.approx(turned)
    assert robot.sensor_frame("lidar") == pytest.approx(np.eye(3))
    assert robot.to_sensor_frame("overhead_lidar") == pytest.approx(np.eye(3))
    chair, charger = load_docks().docks["chair_1"], load_docks().docks["charger"]
    assert chair.dock_pose.x_m == pytest.approx(-0.45 - robot.latch.x_m)
    assert charger.dock_pose.x_m == pytest.approx(-0.60 + robot.rear_camera_xyz_m[0])
    assert chair.staging.x_m == pytest.approx(-4.50 + 0.45 + robot.latch.x_m + 1.5)
    wheel = robot_parameters(robot).axes[robot.axes["fl_drive"].number]
    assert wheel.estop_dec_radps2 == pytest.approx(SHIPPED.emergency_deceleration_mps2 / robot.wheel_radius_m)


def test_its_lidar_finds_it_in_the_map(size: str) -> None:
    """The map is the shipped one, built with the shipped robot."""
    robot, at = load_robot(), Pose2(9.0, 1.2, 0.4)
    params = load(LocalizationParams, "ndt_localization")
    solver = SweepSolver(load_map(params.map).cells, params.ndt, robot.lidar_xyz_m)
    guess = pose_of(at.compose(Pose2(0.15, -0.10, 0.04)), 0.0, UP)
    sweep = sweep_of(robot, load_world("yard"), at)
    request = MatchRequest(0.0, sweep.points, np.zeros((1, 4)), guess, UP, 0.3, None, IDENTITY, 0)
    match = solver.solve(request).match
    assert match is not None
    assert match.score > params.ndt.gate.min_score
    assert float(np.hypot(match.pose[0, 3] - at.x, match.pose[1, 3] - at.y)) < 0.03
    assert abs(math.atan2(match.pose[1, 0], match.pose[0, 0]) - at.yaw) < math.radians(0.3)


def at(**moved: tuple[float, float]) -> dict[str, dict[str, float]]:
    """The shipped modules with these at other places."""
    places = dict(zip(SHIPPED.modules, SHIPPED.module_positions_m(), strict=True)) | moved
    return {name: {"x_m": x, "y_m": y} for name, (x, y) in places.items()}


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        (
            "footprint",
            {"front_m": 0.3, "rear_m": -0.3, "width_m": 0.7},
            "footprint must hold the chassis and the wheels",
        ),
        ("modules", at(fl=(0.30, 0.33)), "footprint must hold the chassis and the wheels"),
        ("modules", at(rl=(-0.45, 0.25)), "footprint must hold the chassis and the wheels"),
        ("modules", at(fl=(0.30, -0.25), fr=(0.30, 0.25)), "base_link must lie between the modules"),
        ("modules", at(rl=(0.02, 0.25), rr=(0.02, -0.25)), "base_link must lie between the modules"),
        (
            "modules",
            at(fl=(0.02, 0.02), fr=(0.35, -0.25), rl=(-0.25, 0.25)),
            "no module may lie between the three others",
        ),
        ("modules", {"fl": {"x_m": 0.3, "y_m": 0.25}}, "modules must be fl, fr, rl, rr"),
        ("footprint_with_chair", {"front_m": 1.4, "rear_m": -0.4, "width_m": 0.8}, "footprint_with_chair must hold"),
        ("chassis", {"length_m": 0.9, "width_m": 0.5, "bottom_m": 0.5, "top_m": 0.4}, "top_m must be above bottom_m"),
    ],
)
def test_dimensions_that_contradict_each_other_are_refused(
    field: str, value: object, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = yaml.safe_load((config_dir() / "robot.yaml").read_text(encoding="utf-8"))
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump({**data, field: value}), encoding="utf-8")
    monkeypatch.setenv("ROBOT_STACK_CONFIG", str(tmp_path))
    with pytest.raises(ConfigError, match=message):
        load_robot()

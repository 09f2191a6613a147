"""The URDF document, read by MuJoCo: its frames, joints and looks are those of the robot's configuration."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.contract import frames
from robot_stack.core.camera import mounting
from robot_stack.core.config import config_dir, read_yaml, validate
from robot_stack.core.robot import Robot, load_robot
from robot_stack.core.robot_description import robot_description
from robot_stack.core.robot_shape import load_robot_shape, robot_solids
from tests.support.robots import SIZES
from tests.support.urdf import Urdf

SHAPE = load_robot_shape()
ANGLES = dict(zip(frames.JOINTS, (0.3, -0.7, 4.0, 1.2, -9.0, math.pi, 0.1, 2.5), strict=True))


@pytest.fixture(params=["shipped", *SIZES])
def robot(request: pytest.FixtureRequest) -> Robot:
    if request.param == "shipped":
        return load_robot()
    return validate(Robot, SIZES[request.param].robot(read_yaml(config_dir() / "robot.yaml")), "robot.yaml")


def test_wheels_are_where_the_drawn_robot_has_them(robot: Robot) -> None:
    """All visuals of base and wheels, at arbitrary joint angles."""
    urdf = Urdf(robot_description(robot, SHAPE))
    assert sorted(urdf.joints) == sorted(frames.JOINTS)
    assert urdf.links[0] == frames.BASE_LINK
    drawn = robot_solids(robot, SHAPE, ANGLES)
    for part, link in {
        "base": frames.BASE_LINK,
        **{f"{m}_wheel": frames.wheel_link(m) for m in frames.MODULES},
    }.items():
        expected = [item for item in drawn if item.part == part]
        found = urdf.visual_poses(link, ANGLES)
        assert len(found) == len(expected) > 1
        for item, (pose, size_m) in zip(expected, found, strict=True):
            assert pose == pytest.approx(item.pose, abs=1e-6), item
            x, y, z = (0.5 * edge for edge in item.solid.size_m)
            assert size_m == pytest.approx((x, y, z) if item.solid.kind == "box" else (x, z, 0.0), abs=1e-6), item


def test_wheel_frames_keep_the_wheel_centre(robot: Robot) -> None:
    poses = Urdf(robot_description(robot, SHAPE)).link_poses(ANGLES)
    for module, (x, y) in zip(frames.MODULES, robot.module_positions_m(), strict=True):
        for link in (frames.steering_link(module), frames.wheel_link(module)):
            assert poses[link][:3, 3] == pytest.approx((x, y, robot.wheel_radius_m), abs=1e-6)
        steer_rad = ANGLES[f"{module}_steer"]
        assert poses[frames.steering_link(module)][:2, 0] == pytest.approx(
            (math.cos(steer_rad), math.sin(steer_rad)), abs=1e-6
        )


def test_sensor_frames_are_those_that_their_drivers_publish(robot: Robot) -> None:
    poses = Urdf(robot_description(robot, SHAPE)).link_poses({})
    for camera in (frames.FRONT_CAMERA, frames.REAR_CAMERA):
        assert poses[camera] == pytest.approx(mounting(robot, camera), abs=1e-6)
    for name, sensor in robot.range_sensors.items():
        assert poses[name][:3, 3] == pytest.approx(sensor.xyz_m, abs=1e-6)
        assert poses[name][:3, :3] == pytest.approx(robot.sensor_frame(name), abs=1e-6)
    assert poses[frames.IMU] == pytest.approx(np.eye(4) + _shift(robot.imu_xyz_m), abs=1e-6)


def _shift(xyz_m: tuple[float, float, float]) -> np.ndarray:
    pose = np.zeros((4, 4))
    pose[:3, 3] = xyz_m
    return pose

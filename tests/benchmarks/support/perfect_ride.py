"""A ride with perfect encoders, and how far odometries end from where it really went."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.config import load
from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import Robot
from robot_stack.drive.odometry import Encoders, SwerveOdometry
from robot_stack.drive.params import SwerveControllerParams

RATE_HZ = 50
_FINE_STEPS = 100  # integration steps of the truth within one reading

Array = NDArray[np.floating[Any]]


@dataclass(frozen=True, slots=True)
class PerfectRide:
    """Readings of perfect encoders on a ride, and its true path.

    stamps_s: (n,). drive_m, steer_rad: (4, n), accumulated way of the wheels and headings without wraps. x_m, y_m,
    yaw_rad: (n,), the true pose in the frame of the start. distance_m: length of the path.
    """

    stamps_s: Array
    drive_m: Array
    steer_rad: Array
    x_m: Array
    y_m: Array
    yaw_rad: Array
    distance_m: float

    def encoders(self, index: int, wheel_radius_m: float) -> Encoders:
        drive = [float(way) / wheel_radius_m for way in self.drive_m[:, index]]
        steer = [float(angle) for angle in self.steer_rad[:, index]]
        return Encoders(
            float(self.stamps_s[index]),
            (drive[0], drive[1], drive[2], drive[3]),
            (steer[0], steer[1], steer[2], steer[3]),
        )

    def pose(self, index: int) -> Pose2:
        return Pose2(float(self.x_m[index]), float(self.y_m[index]), float(self.yaw_rad[index]))


def mixed_twist(t_s: Array) -> tuple[Array, Array, Array]:
    """vx, vy (m/s), omega (rad/s) of a ride that curves, slides sideways and turns all the time."""
    vx = 1.0 + 0.4 * np.sin(2.0 * np.pi * 0.11 * t_s)
    vy = 0.6 * np.sin(2.0 * np.pi * 0.17 * t_s + 0.4)
    omega = 0.8 * np.sin(2.0 * np.pi * 0.13 * t_s) + 0.15
    return vx, vy, omega


def perfect_ride(robot: Robot, distance_m: float, rate_hz: int = RATE_HZ) -> PerfectRide:
    """The mixed ride until its path is ``distance_m`` long, by fine midpoint integration."""
    seconds = math.ceil(distance_m)  # the mean speed is above 1 m/s
    step_s = 1.0 / (rate_hz * _FINE_STEPS)
    edges = np.arange(seconds * rate_hz * _FINE_STEPS + 1) * step_s
    middles = edges[:-1] + 0.5 * step_s
    vx, vy, omega = mixed_twist(middles)
    yaw = _accumulated(omega * step_s)
    heading = yaw[:-1] + 0.5 * omega * step_s
    x = _accumulated((np.cos(heading) * vx - np.sin(heading) * vy) * step_s)
    y = _accumulated((np.sin(heading) * vx + np.cos(heading) * vy) * step_s)
    way = _accumulated(np.hypot(vx, vy) * step_s)
    drive, steer = [], []
    edge_vx, edge_vy, edge_omega = mixed_twist(edges)
    for px, py in robot.module_positions_m():
        drive.append(_accumulated(np.hypot(vx - omega * py, vy + omega * px) * step_s))
        steer.append(np.unwrap(np.arctan2(edge_vy + edge_omega * px, edge_vx - edge_omega * py)))
    end = int(np.searchsorted(way, distance_m)) + 1
    take = slice(0, end, _FINE_STEPS)
    return PerfectRide(
        edges[take],
        np.array([row[take] for row in drive]),
        np.array([row[take] for row in steer]),
        x[take],
        y[take],
        yaw[take],
        float(way[take][-1]),
    )


def _accumulated(increments: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(increments)])


def error_m(ride: PerfectRide, robot: Robot) -> float:
    """Distance of the stack's own odometry from the truth at the end."""
    params = load(SwerveControllerParams, "swerve_controller").odometry
    odometry = SwerveOdometry(params, robot)
    last = len(ride.stamps_s) - 1
    for index in range(last):
        odometry.update(ride.encoders(index, robot.wheel_radius_m))
    return odometry.update(ride.encoders(last, robot.wheel_radius_m)).pose.distance_to(ride.pose(last))


def wpilib_error_m(ride: PerfectRide, robot: Robot) -> float:
    """The same for WPILib's odometry with the true yaw as its gyro. Raises ImportError without robotpy-wpimath."""
    from wpimath.geometry import Rotation2d, Translation2d
    from wpimath.kinematics import SwerveDrive4Kinematics, SwerveDrive4Odometry, SwerveModulePosition

    def modules(index: int) -> tuple[Any, Any, Any, Any]:
        ways, angles = ride.drive_m[:, index], ride.steer_rad[:, index]
        a, b, c, d = (
            SwerveModulePosition(float(way), Rotation2d(float(angle))) for way, angle in zip(ways, angles, strict=True)
        )
        return a, b, c, d

    kinematics = SwerveDrive4Kinematics(*(Translation2d(x, y) for x, y in robot.module_positions_m()))
    odometry = SwerveDrive4Odometry(kinematics, Rotation2d(float(ride.yaw_rad[0])), modules(0))
    for index in range(1, len(ride.stamps_s)):
        odometry.update(Rotation2d(float(ride.yaw_rad[index])), modules(index))
    pose = odometry.getPose()
    return ride.pose(len(ride.stamps_s) - 1).distance_to(Pose2(pose.X(), pose.Y(), 0.0))

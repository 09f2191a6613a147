"""Mounting of the LiDAR from a recorded ride: tilt and height by the ground, heading by the motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from robot_stack.core.robot import Robot
from robot_stack.mapping.heading import Heading, heading_of, steps_of
from robot_stack.mapping.lidar_odometry import lidar_odometry
from robot_stack.mapping.params import MappingParams
from robot_stack.mapping.poses import Floats, planar, rotation_of, yaw_of
from robot_stack.mapping.ride import Ride, RideError
from robot_stack.mapping.tilt import Tilt, ground_plane, tilt_of


@dataclass(frozen=True, slots=True)
class MountFound:
    """rotation: (3, 3) to be applied to the sensor's points. yaw_rad: (n,) headings of the sweeps used."""

    rotation: Floats
    tilt: Tilt
    heading: Heading
    yaw_rad: Floats
    sweeps: int

    def rpy_deg(self, before_deg: tuple[float, float, float]) -> tuple[float, float, float]:
        """The mount, about fixed axes x, y, z, for clouds that were recorded with a rotation by ``before_deg``."""
        before = Rotation.from_euler("xyz", before_deg, degrees=True)
        roll, pitch, yaw = (Rotation.from_matrix(self.rotation) * before).as_euler("xyz", degrees=True)
        return float(roll), float(pitch), float(yaw)


def mount_of(ride: Ride, params: MappingParams, robot: Robot) -> MountFound:
    """Raises RideError naming what the ride does not determine."""
    settings, sensor = params.mount, np.asarray(robot.lidar_xyz_m, np.float64)
    stamps = np.array([sweep.stamp_s for sweep in ride.sweeps])
    poses = ride.odometry.at(stamps)
    driven = np.array([planar(*row) for row in poses])
    tilt, yaw = _tilt(ride, driven, params, sensor)
    levelled = [(sweep.points - sensor) @ tilt.rotation.T + sensor for sweep in ride.sweeps]
    pairs = steps_of(driven, settings.step_m)
    distance_m = len(pairs) * settings.step_m
    if distance_m < settings.shortest_m:
        raise RideError(
            f"the ride of {distance_m:.1f} m is too short for the heading: at least {settings.shortest_m:g} m"
        )
    seen, matched = lidar_odometry(levelled, driven, params.lidar_odometry)
    whole = [(first, last) for first, last in pairs if matched[first + 1 : last + 1].all()]
    if len(whole) < 0.5 * len(pairs):
        raise RideError(f"too little structure above the ground: only {len(whole)} of {len(pairs)} steps are matched")
    heading = heading_of(seen, driven, sensor[:2], whole)
    _check("heading", heading.deviation_rad, settings.deviation_deg, "drive longer, with more structure around")
    turned = rotation_of(np.array([0.0, 0.0, heading.yaw_rad])) @ tilt.rotation
    return MountFound(turned, tilt, heading, yaw, len(ride.sweeps))


def _tilt(ride: Ride, driven: Floats, params: MappingParams, sensor: Floats) -> tuple[Tilt, Floats]:
    settings = params.mount
    found = [(ground_plane(sweep.points.astype(np.float64), settings), k) for k, sweep in enumerate(ride.sweeps)]
    planes = [plane for plane, _ in found if plane is not None]
    if len(planes) < settings.fewest_sweeps:
        raise RideError(f"only {len(planes)} sweeps show ground, at least {settings.fewest_sweeps} are needed")
    yaw = yaw_of(driven[[k for plane, k in found if plane is not None]])
    try:
        tilt = tilt_of(planes, yaw, max(1, len(steps_of(driven, settings.step_m))), sensor)
    except np.linalg.LinAlgError:
        raise RideError(
            "the ride does not turn: a tilted mount cannot be distinguished from sloping ground; drive a full circle"
        ) from None
    _check("tilt", tilt.deviation_rad, settings.deviation_deg, "drive a full circle on even ground")
    return tilt, yaw


def _check(what: str, deviation_rad: float, most_deg: float, advice: str) -> None:
    deviation_deg = math.degrees(deviation_rad)
    if not deviation_deg <= most_deg:
        raise RideError(
            f"the deviation of the {what} is {deviation_deg:.2f} deg, allowed are {most_deg:g} deg: {advice}"
        )

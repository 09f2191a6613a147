"""A small room and a ride through it with a coarse LiDAR: the inputs of the map builder, and the ground truth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from robot_stack.core.config import load
from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.core.point_cloud import SWEEP
from robot_stack.core.robot import load_robot
from robot_stack.mapping.collector import Collector
from robot_stack.mapping.params import MappingParams

# (low, high) corners of boxes, m: four walls, a pillar in the middle, two boxes.
WALLS = [
    ((-6.0, -5.2, 0.0), (6.0, -5.0, 2.0)),
    ((-6.0, 5.0, 0.0), (6.0, 5.2, 2.0)),
    ((-6.2, -5.0, 0.0), (-6.0, 5.0, 2.0)),
    ((6.0, -5.0, 0.0), (6.2, 5.0, 2.0)),
]
BOXES = [
    ((-0.4, -0.7, 0.0), (0.5, 0.6, 2.0)),
    ((-5.0, 3.6, 0.0), (-4.0, 4.4, 1.0)),
    ((4.6, -4.4, 0.0), (5.4, -3.0, 1.2)),
]
VISITOR = ((3.9, 3.1, 0.0), (4.3, 3.5, 1.7))
START = Pose2(3.0, 0.0, 0.5 * math.pi)
SWEEP_S, PERIOD_S, SPEED_MPS, RADIUS_M = 0.1, 0.4, 0.8, 3.0
DURATION_S = 31.0
STAND_S = 2.0
# Errors of the wheels: too long a distance, and a rotation that did not happen.
SCALE_ERROR, YAW_ERROR_RADPM = 0.02, 0.01
EPOCH_S = 1_700_000_000.0
NOISE_M = 0.01


@dataclass(frozen=True)
class Recorded:
    """Times in s since the start. sweeps: (time, points); odometry: (time, pose); true: pose of each sweep in map."""

    sweeps: list
    odometry: list
    true: list


def true_pose(time_s: float) -> Pose2:
    """Returns the pose in map: first at rest, then on a circle round the pillar."""
    turned = SPEED_MPS * max(0.0, time_s - STAND_S) / RADIUS_M
    return Pose2(RADIUS_M * math.cos(turned), RADIUS_M * math.sin(turned), START.yaw + turned)


def odometry_pose(time_s: float) -> Pose2:
    """Returns the pose in odom with the wheels' errors: from the identity on, a circle of another radius."""
    way = SPEED_MPS * max(0.0, time_s - STAND_S)
    turned = way / RADIUS_M + YAW_ERROR_RADPM * way
    radius = way * (1.0 + SCALE_ERROR) / turned if turned > 0.0 else 0.0
    return Pose2(radius * math.sin(turned), radius * (1.0 - math.cos(turned)), turned)


def cast(origins, directions, boxes):
    """Returns the (n,) distance to the nearest box or the ground z = 0, inf for neither; slab method."""
    with np.errstate(divide="ignore", invalid="ignore"):
        nearest = np.where(directions[:, 2] < 0.0, -origins[:, 2] / directions[:, 2], np.inf)
        for low, high in boxes:
            one, two = (np.array(low) - origins) / directions, (np.array(high) - origins) / directions
            enter = np.nanmax(np.minimum(one, two), axis=1)
            leave = np.nanmin(np.maximum(one, two), axis=1)
            hit = (enter <= leave) & (enter > 0.0)
            nearest = np.where(hit, np.minimum(nearest, enter), nearest)
    return nearest


def sweep(time_s: float, random, visitor: bool):
    """Returns an (n,) SWEEP, measured during 0.1 s of driving: 8 rings of 110 rays, the nearest hit of each."""
    azimuth, elevation = np.meshgrid(np.arange(110) / 110.0, np.radians([-28, -20, -14, -9, -5, -1, 4, 9]))
    since = (azimuth.ravel() - 1.0) * SWEEP_S
    poses = [true_pose(time_s + offset) for offset in (azimuth[0] - 1.0) * SWEEP_S]
    yaw = np.tile([pose.yaw for pose in poses], 8)
    lidar = np.array(load_robot().lidar_xyz_m)
    c, s = np.cos(yaw), np.sin(yaw)
    x, y = np.tile([pose.x for pose in poses], 8), np.tile([pose.y for pose in poses], 8)
    origins = np.stack([x + c * lidar[0], y + s * lidar[0], np.full(len(x), lidar[2])], axis=1)
    angle = 2.0 * np.pi * azimuth.ravel() + random.uniform(0.0, 0.05)
    flat = np.stack([np.cos(angle), np.sin(angle), np.tan(elevation.ravel())], axis=1)
    flat /= np.linalg.norm(flat, axis=1)[:, None]
    directions = np.stack([c * flat[:, 0] - s * flat[:, 1], s * flat[:, 0] + c * flat[:, 1], flat[:, 2]], axis=1)
    ranges = cast(origins, directions, WALLS + BOXES + ([VISITOR] if visitor else []))
    seen = np.isfinite(ranges)
    points = np.zeros(int(seen.sum()), SWEEP)
    measured = flat[seen] * (ranges[seen] + random.normal(0.0, NOISE_M, seen.sum()))[:, None]
    points["x"], points["y"], points["z"] = measured.T
    points["time"] = since[seen]
    return points


@cache
def recorded() -> Recorded:
    """Returns a ride of slightly more than one round, with a visitor during the first 8 s."""
    random = np.random.default_rng(3)
    times = np.arange(0.5, DURATION_S, PERIOD_S)
    sweeps = [(float(time), sweep(float(time), random, visitor=time < 8.0)) for time in times]
    odometry = [(float(time), odometry_pose(float(time))) for time in np.arange(0.0, DURATION_S + 0.5, 0.02)]
    return Recorded(sweeps, odometry, [true_pose(float(time)) for time in times])


def part(recording: Recorded, from_s: float, until_s: float) -> Recorded:
    """Returns a piece of the ride as one of its own: its odometry begins at the identity."""
    first = next(pose for time_s, pose in recording.odometry if time_s >= from_s)
    return Recorded(
        [(time_s, points) for time_s, points in recording.sweeps if from_s + SWEEP_S < time_s < until_s],
        [(time_s, pose.relative_to(first)) for time_s, pose in recording.odometry if from_s <= time_s <= until_s],
        [],
    )


def in_order(recording: Recorded):
    """Yields (time, points, None) of a sweep and (time, None, pose) of odometry, as a robot sends them."""
    sweeps = iter(recording.sweeps)
    waiting = next(sweeps, None)
    for time_s, pose in recording.odometry:
        while waiting is not None and waiting[0] <= time_s:
            yield *waiting, None
            waiting = next(sweeps, None)
        yield time_s, None, pose


def params() -> MappingParams:
    """The configured parameters, adapted to few points."""
    base = load(MappingParams, "mapping").model_dump()
    base["lidar_odometry"]["fewest_points"] = 50
    base["refinement"] |= {"rounds": 3, "cell_points": 6}
    base["loops"] |= {"time_apart_s": 12.0, "every_m": 1.0, "radius_m": 1.5, "drift_share": 0.05}
    base["joining"] |= {"every_m": 1.0}
    base["grid"] |= {"fewest_ground_points": 2, "resolution_m": 0.2}
    base["cells"]["fewest_points"] = 8
    base["mount"]["deviation_deg"] = 0.4
    return MappingParams.model_validate(base)


def collected(recording: Recorded):
    """Returns the ride as the reader of recordings does. The IMU measures no slope, and its gyro has a bias."""
    collector = Collector(params().sweeps, load_robot())
    for time_s in np.arange(0.0, DURATION_S + 0.5, 0.02):
        rate = SPEED_MPS / RADIUS_M if time_s > STAND_S else 0.0
        collector.imu(EPOCH_S + float(time_s), 0.0, 0.0, rate + 0.002)
    for time_s, points, pose in in_order(recording):
        if pose is None:
            collector.sweep(EPOCH_S + time_s, points)
        else:
            collector.odometry(EPOCH_S + time_s, pose.x, pose.y, pose.yaw)
    return collector.finish()


assert odometry_pose(0.0) == IDENTITY

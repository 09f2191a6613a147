"""A recorded ride as input of the map builder: de-skewed sweeps, wheel odometry, inertial unit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_stack.core.point_cloud import Points, xyz_of
from robot_stack.core.robot import Footprint, Robot
from robot_stack.mapping.cells import voxel_keys
from robot_stack.mapping.poses import Floats, from_angles, inverse, pose_of


class RideError(Exception):
    """No map can be built from the ride. The message is one line for people."""


@dataclass(frozen=True, slots=True)
class Track:
    """Readings in the order of their stamps: stamp_s (n,), values (n, k). Angles among them are unwrapped."""

    stamp_s: Floats
    values: Floats

    def at(self, stamp_s: Floats) -> Floats:
        """(m, k) values at the stamps, interpolated linearly, constant beyond the ends."""
        return np.stack([np.interp(stamp_s, self.stamp_s, column) for column in self.values.T], axis=1)

    def covers(self, begin_s: float, end_s: float, slack_s: float) -> bool:
        """True for readings from ``begin_s`` to ``end_s`` without a gap longer than ``slack_s``."""
        inside = self.stamp_s[(self.stamp_s > begin_s - slack_s) & (self.stamp_s < end_s + slack_s)]
        return bool(len(inside)) and bool(np.diff(np.concatenate([[begin_s], inside, [end_s]])).max() <= slack_s)


@dataclass(frozen=True, slots=True)
class Sweep:
    """points: (n, 3) float32 m in base_link at ``stamp_s``, de-skewed to that moment."""

    stamp_s: float
    points: npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Ride:
    """odometry: x, y m, yaw rad of base_link in odom. attitude: roll, pitch rad. turn_rate: rad/s about z of base_link.

    All stamps are of one clock. attitude and turn_rate may be empty.
    """

    sweeps: tuple[Sweep, ...]
    odometry: Track
    attitude: Track
    turn_rate: Track


def track(stamps_s: list[float], values: list[tuple[float, ...]], angles: tuple[int, ...] = ()) -> Track:
    """A track of readings in any order, without duplicate stamps and values that are not finite."""
    stamp = np.asarray(stamps_s, np.float64)
    table = np.asarray(values, np.float64).reshape(len(stamp), -1)
    good = np.isfinite(stamp) & np.isfinite(table).all(axis=1)
    stamp, first = np.unique(stamp[good], return_index=True)
    table = table[good][first]
    for column in angles:
        table[:, column] = np.unwrap(table[:, column])
    return Track(stamp, table)


def deskewed(points: Points, stamp_s: float, odometry: Track, robot: Robot, nearest_m: float, voxel_m: float) -> Sweep:
    """A sweep (n,) of layout SWEEP in base_link at its stamp: each point is corrected by the robot's motion since.

    Left out: points that are not finite, nearer than ``nearest_m`` to the sensor, or within the robot's own outline. Of
    each voxel of ``voxel_m`` in base_link the first point stays, not the mean, which would blur edges.
    """
    xyz = xyz_of(points).astype(np.float64)
    good = np.isfinite(xyz).all(axis=1) & (np.einsum("ij,ij->i", xyz, xyz) > nearest_m * nearest_m)
    xyz, time = xyz[good] + np.asarray(robot.lidar_xyz_m), points["time"][good].astype(np.float64)
    then, now = odometry.at(stamp_s + time), odometry.at(np.array([stamp_s]))[0]
    yaw = then[:, 2] - now[2]
    dx, dy = then[:, 0] - now[0], then[:, 1] - now[1]
    cos_now, sin_now, c, s = np.cos(now[2]), np.sin(now[2]), np.cos(yaw), np.sin(yaw)
    x = cos_now * dx + sin_now * dy + c * xyz[:, 0] - s * xyz[:, 1]
    y = -sin_now * dx + cos_now * dy + s * xyz[:, 0] + c * xyz[:, 1]
    own = _inside(x, y, robot.footprint_with_chair)
    still = np.stack([x, y, xyz[:, 2]], axis=1)[~own]
    _, first = np.unique(voxel_keys(still, voxel_m), return_index=True)
    return Sweep(stamp_s, still[np.sort(first)].astype(np.float32))


def driven(ride: Ride) -> Floats:
    """(n, 4, 4) base_link at each sweep by wheel odometry alone, on the slopes measured by the inertial unit.

    Begins at z = 0 with odometry's x, y, yaw. Between two sweeps the robot moves in the plane of its wheels.
    """
    stamps = np.array([sweep.stamp_s for sweep in ride.sweeps])
    planar = ride.odometry.at(stamps)
    roll, pitch = ride.attitude.at(stamps).T if len(ride.attitude.stamp_s) else np.zeros((2, len(stamps)))
    rotation = from_angles(roll, pitch, planar[:, 2])
    flat = pose_of(
        np.concatenate([planar[:, :2], np.zeros((len(planar), 1))], axis=1),
        from_angles(0.0 * roll, 0.0 * roll, planar[:, 2]),
    )
    steps = (inverse(flat[:-1]) @ flat[1:])[:, :3, 3]
    place = np.zeros((len(stamps), 3))
    place[0, :2] = planar[0, :2]
    for i, step in enumerate(steps):
        place[i + 1] = place[i] + 0.5 * (rotation[i] + rotation[i + 1] @ rotation_step(flat, i)) @ step
    return pose_of(place, rotation)


def rotation_step(flat: Floats, i: int) -> Floats:
    """Rotates a vector from the frame before a step into the frame after it."""
    turn: Floats = flat[i + 1, :3, :3].T @ flat[i, :3, :3]
    return turn


def _inside(x: Floats, y: Floats, outline: Footprint) -> npt.NDArray[np.bool_]:
    margin_m = 0.10  # for parts that stick out: a shell, a rider's feet
    along = (x > outline.rear_m - margin_m) & (x < outline.front_m + margin_m)
    return along & (np.abs(y) < 0.5 * outline.width_m + margin_m)

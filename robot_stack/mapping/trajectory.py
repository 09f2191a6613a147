"""The trajectory of the ride: fuses wheel odometry, gyro, LiDAR odometry, loops and the horizon."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robot_stack.mapping.loops import Loop
from robot_stack.mapping.params import Loops, MappingParams, WheelOdometry
from robot_stack.mapping.pose_graph import Edges, Levels, solve
from robot_stack.mapping.poses import Floats, from_angles, inverse, pose_of
from robot_stack.mapping.ride import Ride

# Deviations of unmeasured components. m, rad.
_UNKNOWN_M, _UNKNOWN_RAD = 1.0, 0.1
_ANCHOR = 1e4


@dataclass(frozen=True, slots=True)
class Knowledge:
    """The measurements within a ride, or within several: all except loops and matches to the map."""

    chain: tuple[Edges, ...]
    levels: Levels

    def solve(
        self, poses: Floats, start: Floats | None, loops: Sequence[Loop], settings: Loops, more: Sequence[Edges] = ()
    ) -> Floats:
        """Poses optimised from the given ones; the first stays at ``start`` in place and heading, unless it is None."""
        edges = [*([] if start is None else [_anchor(start)]), *self.chain, *more]
        if loops:
            edges.append(loop_edges(loops, settings))
        return solve(poses, edges, self.levels)

    def followed_by(self, other: Knowledge, count: int) -> Knowledge:
        """Of both rides' poses, one after the other; count: of this one's."""
        chain = (*self.chain, *(edges.moved_by(count) for edges in other.chain))
        index = np.concatenate([self.levels.index, other.levels.index + count])
        up = np.concatenate([self.levels.up, other.levels.up])
        return Knowledge(chain, Levels(index, up, self.levels.weight))


def knowledge_of(ride: Ride, driven: Floats, lidar: Floats, matched: np.ndarray, params: MappingParams) -> Knowledge:
    stamps = np.array([sweep.stamp_s for sweep in ride.sweeps])
    chain = [_wheel_edges(driven, params.wheel_odometry), _lidar_edges(lidar, matched, params)]
    gyro = _gyro_edges(ride, stamps, params.wheel_odometry)
    if gyro is not None:
        chain.append(gyro)
    return Knowledge(tuple(chain), _levels(ride, stamps, params.wheel_odometry))


def loop_edges(loops: Sequence[Loop], settings: Loops) -> Edges:
    first, second = np.array([[loop.earlier, loop.later] for loop in loops], np.int64).reshape(-1, 2).T
    weight = _weights(len(loops), settings.deviation_m, settings.deviation_rad)
    return Edges(first, second, np.stack([loop.measured for loop in loops]), weight, settings.robust)


def _weights(count: int, deviation_m: float, deviation_rad: float) -> Floats:
    return np.tile([1.0 / deviation_m] * 3 + [1.0 / deviation_rad] * 3, (count, 1))


def _steps(poses: Floats) -> tuple[np.ndarray, np.ndarray, Floats]:
    index = np.arange(len(poses) - 1)
    return index, index + 1, inverse(poses[:-1]) @ poses[1:]


def _anchor(start: Floats) -> Edges:
    """Anchors place and heading; roll and pitch come from the horizon."""
    weight = np.full((1, 6), _ANCHOR)
    weight[0, 3:5] = 1e-3
    return Edges(np.array([-1]), np.array([0]), start[None], weight)


def _wheel_edges(driven: Floats, s: WheelOdometry) -> Edges:
    first, second, steps = _steps(driven)
    way = np.linalg.norm(steps[:, :3, 3], axis=1)
    place = s.deviation_m + s.deviation_share * way
    yaw = s.deviation_rad + s.deviation_rad_per_m * way
    # Roll and pitch in these steps are the inertial unit's differences, good over a short time.
    tilt = np.full(len(way), s.deviation_rad)
    return Edges(first, second, steps, 1.0 / np.stack([place, place, place, tilt, tilt, yaw], axis=1))


def _lidar_edges(lidar: Floats, matched: np.ndarray, params: MappingParams) -> Edges:
    s = params.lidar_odometry
    first, second, steps = _steps(lidar)
    deviation = [s.deviation_m, s.deviation_m, _UNKNOWN_M, _UNKNOWN_RAD, _UNKNOWN_RAD, s.deviation_rad]
    used = matched[1:]
    # Robust, so that a step lost by KISS-ICP does not bend the rest.
    return Edges(first[used], second[used], steps[used], np.tile(1.0 / np.array(deviation), (int(used.sum()), 1)), 3.0)


def _gyro_edges(ride: Ride, stamps: Floats, s: WheelOdometry) -> Edges | None:
    """Changes of heading by the gyro, if the ride has a standstill from which its bias is measured."""
    gyro = ride.turn_rate
    standing = _standing(ride, gyro.stamp_s, s)
    if len(gyro.stamp_s) < 2 or not standing.any():
        return None
    rate = gyro.values[:, 0] - gyro.values[standing, 0].mean()
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(gyro.stamp_s))])
    yaw = np.diff(np.interp(stamps, gyro.stamp_s, turned))
    elapsed = np.diff(stamps)
    zero = np.zeros(len(yaw))
    measured = pose_of(np.zeros((len(yaw), 3)), from_angles(zero, zero, yaw))
    weight = np.full((len(yaw), 6), 1e-6)
    weight[:, 5] = 1.0 / (s.gyro_deviation_radps * elapsed + 1e-3 * np.sqrt(elapsed))
    index = np.arange(len(yaw))
    return Edges(index, index + 1, measured, weight)


def _standing(ride: Ride, stamps: Floats, s: WheelOdometry) -> np.ndarray:
    """(n,) True at stamps where the wheels had not moved for ``standing_s``."""
    if not len(stamps):
        return np.zeros(0, bool)
    before, now = ride.odometry.at(stamps - s.standing_s), ride.odometry.at(stamps)
    step = np.abs(now - before) / s.standing_s
    slow = (step[:, :2].max(axis=1) < s.standing_mps) & (step[:, 2] < s.standing_radps)
    inside = (stamps - s.standing_s >= ride.odometry.stamp_s[0]) & (stamps <= ride.odometry.stamp_s[-1])
    found: np.ndarray = slow & inside
    return found


def _levels(ride: Ride, stamps: Floats, s: WheelOdometry) -> Levels:
    weight = 1.0 / s.level_deviation_rad
    if not len(ride.attitude.stamp_s):
        return Levels(weight=weight)
    roll, pitch = ride.attitude.at(stamps).T
    up = from_angles(roll, pitch, 0.0 * roll)[:, 2, :]
    return Levels(np.arange(len(stamps)), up, weight)

"""The display for staff during a mapping ride by hand: the path, the mapped area beside it, warnings."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import Pose2, wrap_angle
from robot_stack.mapping.cells import unpack_keys, voxel_keys
from robot_stack.mapping.course import begun_at
from robot_stack.mapping.lidar_odometry import LidarOdometry, above_ground
from robot_stack.mapping.params import MappingParams, Teach
from robot_stack.mapping.poses import Floats, inverse, transform, yaw_of
from robot_stack.mapping.ride import Ride, driven

# So many sweeps without odometry are tolerated, as at the start.
_FEW, _FEW_SHARE = 5, 0.1

Cells = npt.NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Inputs:
    """Input statistics so far: ages of the newest messages, s; messages lost because the disk was too slow."""

    sweeps: int
    without_odometry: int
    points_age_s: float
    odometry_age_s: float
    imu_age_s: float
    lost: int


class Motion:
    """Speed and standstill by wheel odometry. Times are odometry's stamps."""

    def __init__(self, settings: Teach) -> None:
        self._settings = settings
        self._still_since_s: float | None = None
        self.speed_mps = self.turn_radps = 0.0
        self.standing_s = 0.0
        self.longest_s = 0.0

    def update(self, stamp_s: float, vx_mps: float, vy_mps: float, omega_radps: float) -> None:
        self.speed_mps, self.turn_radps = math.hypot(vx_mps, vy_mps), abs(omega_radps)
        # Values that are not finite do not count as standing; a clock that restarts begins a new standstill.
        still = self.speed_mps <= self._settings.standing_mps and self.turn_radps <= self._settings.standing_radps
        if not still or self._still_since_s is None or not stamp_s >= self._still_since_s:
            self._still_since_s = stamp_s if still else None
        self.standing_s = stamp_s - self._still_since_s if self._still_since_s is not None else 0.0
        self.longest_s = max(self.longest_s, self.standing_s)


class GrowingMap:
    """The ride by LiDAR odometry and by the wheels, and what was seen as near as the grid takes it in.

    This is odometry: loops are closed and moving objects removed only when the map is built. origin: base_link in
    map at the first sweep; None: the map begins there.
    """

    def __init__(self, params: MappingParams, origin: Pose2 | None) -> None:
        self._params = params
        self._start = origin or Pose2(0.0, 0.0, 0.0)
        self._odometry = LidarOdometry(params.lidar_odometry)
        self.by_lidar: list[Floats] = []
        self.by_wheels: list[Floats] = []
        self.matched = True
        self.driven_m = 0.0
        self._ground = self._structure = np.empty(0, np.int64)

    def add(self, ride: Ride, fresh: int) -> None:
        """ride: the newest sweeps, from ``Collector.newest``: the last ``fresh`` and the one before them."""
        wheels = begun_at(driven(ride), self._start)
        for i in range(len(wheels) - fresh, len(wheels)):
            points = ride.sweeps[i].points.astype(np.float64)
            if not self.by_lidar:
                guess = by_wheels = wheels[i]
            else:
                guess = self.by_lidar[-1] @ inverse(wheels[i - 1]) @ wheels[i]
                by_wheels = self.by_wheels[-1] @ inverse(wheels[i - 1]) @ wheels[i]
            pose, matched = self._odometry.add(points, guess)
            # The first sweep has no earlier one to match.
            self.matched = matched or not self.by_lidar
            if self.by_lidar:
                self.driven_m += float(np.linalg.norm((pose - self.by_lidar[-1])[:3, 3]))
            self.by_lidar.append(pose)
            self.by_wheels.append(by_wheels)
            self._see(points, pose)

    def _see(self, points: Floats, pose: Floats) -> None:
        near = points[(points[:, :2] ** 2).sum(axis=1) < self._params.grid.range_m**2]
        s = self._params.lidar_odometry
        standing = above_ground(near, s.ground_cell_m, s.above_ground_m)
        self._structure = np.union1d(self._structure, self._columns(standing, pose))
        self._ground = np.union1d(self._ground, self._columns(near, pose))

    def _columns(self, points: Floats, pose: Floats) -> npt.NDArray[np.int64]:
        flat = transform(pose, points)
        flat[:, 2] = 0.0
        return np.unique(voxel_keys(flat, self._params.grid.resolution_m))

    @property
    def seen(self) -> Cells:
        """(n, 2) observed cells of the grid's resolution, floor(x / resolution)."""
        return unpack_keys(self._ground)[:, :2]

    @property
    def structure(self) -> Cells:
        """(n, 2) cells with structure above the ground."""
        return unpack_keys(self._structure)[:, :2]

    @property
    def size_m(self) -> tuple[float, float]:
        """Size of the observed area along x and y of map."""
        seen = self.seen
        if not len(seen):
            return 0.0, 0.0
        width, height = (np.ptp(seen, axis=0) + 1) * self._params.grid.resolution_m
        return float(width), float(height)

    @property
    def apart(self) -> tuple[float, float]:
        """(m, rad) between the present poses of LiDAR odometry and wheels."""
        if not self.by_lidar:
            return 0.0, 0.0
        lidar, wheels = self.by_lidar[-1], self.by_wheels[-1]
        turned = wrap_angle(float(yaw_of(lidar[None])[0] - yaw_of(wheels[None])[0]))
        return float(np.linalg.norm((lidar - wheels)[:2, 3])), abs(turned)

    @property
    def from_begin_m(self) -> float:
        """Distance to the start of the ride, in plan."""
        return float(np.linalg.norm((self.by_lidar[-1] - self.by_lidar[0])[:2, 3])) if self.by_lidar else 0.0


def status_line(growing: GrowingMap) -> str:
    width, height = growing.size_m
    apart_m, apart_rad = growing.apart
    return (
        f"{growing.driven_m:.1f} m, {len(growing.by_lidar)} sweeps, {width:.0f} x {height:.0f} m seen, "
        f"begin {growing.from_begin_m:.1f} m away, "
        f"LiDAR and wheels {apart_m:.2f} m and {math.degrees(apart_rad):.1f} deg apart"
    )


def warnings_of(inputs: Inputs, motion: Motion, growing: GrowingMap, settings: Teach) -> list[str]:
    """Warnings that the driver should act on, a line each."""
    s = settings
    found = []
    if inputs.points_age_s > s.silent_s:
        found.append(f"no LiDAR sweep for more than {s.silent_s:g} s: stop until sweeps arrive")
    if inputs.odometry_age_s > s.silent_s:
        found.append(f"no odometry for more than {s.silent_s:g} s: stop until it arrives")
    if inputs.imu_age_s > s.silent_s:
        found.append("no inertial unit: slopes and the gyro are missing")
    if inputs.lost:
        found.append("messages are lost: the disk is too slow")
    if inputs.without_odometry > max(_FEW, _FEW_SHARE * inputs.sweeps):
        found.append("sweeps without odometry are left out")
    if growing.by_lidar and not growing.matched:
        found.append("no structure around: wheel odometry only")
    if motion.speed_mps > s.speed_mps or motion.turn_radps > s.turn_radps:
        found.append(f"too fast: at most {s.speed_mps:g} m/s and {math.degrees(s.turn_radps):.0f} deg/s")
    if motion.standing_s > s.idle_s:
        found.append(f"at standstill for more than {s.idle_s:g} s: the map does not grow; drive on, or end the ride")
    if len(growing.by_lidar) > 1 and motion.longest_s < s.begin_s and motion.standing_s == 0.0:
        found.append(f"no standstill of {s.begin_s:g} s yet: the gyro's bias is unknown")
    if growing.apart[0] > s.apart_m + s.apart_share * growing.driven_m:
        found.append("LiDAR odometry and wheels disagree: slipping wheels, or too little structure around")
    return found

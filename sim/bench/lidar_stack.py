"""The stack's kernels on the physics with a LiDAR in it: drive, odometry, localization against a map, a route follower.

Sweeps are those of the simulated sensor, seen from the true motion; they reach the localizer when the last column has
fired and been carried over, matches take the time that they would take, and the robot drives by the pose it believes.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.bench.framework import BenchError
from robot_stack.core.config import load
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.site_map import Cells
from robot_stack.drive.arbitration import Source
from robot_stack.drive.odometry import Odometry
from robot_stack.localization.map_localizer import MapLocalizer
from robot_stack.localization.ndt.gate import Confidence
from robot_stack.localization.ndt.solver import SweepSolver
from robot_stack.localization.params import LocalizationParams
from sim.bench.kernel_stack import KernelStack
from sim.camera.motion import Track
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import build_scene
from sim.lidar.sensor import Lidar
from sim.plant.imu import ImuSample
from sim.plant.world import Setup

Array = NDArray[np.float64]
_TRACK_STEPS = 5
_SWEEP_S = 0.1
_CARRIED_S = 0.015  # from the last column to the node: 3.6 MB are packed, sent and read
_MATCHED_S = 0.010
_SETTLE_S = 3.0


@dataclass(frozen=True, slots=True)
class Fix:
    """The published pose beside the truth at its stamp; pose is None while none is published.

    sigma_m: standard deviation of its position, as published.
    """

    time_s: float
    pose: Pose2 | None
    truth: Pose2
    height_m: float
    quality: float
    sigma_m: float
    score: float
    confidence: Confidence

    @property
    def error_m(self) -> float:
        return math.inf if self.pose is None else self.pose.distance_to(self.truth)


class LidarStack(KernelStack):
    """world: what the sensor sees (setup.world is what the physics has). start: what the localizer is told.

    people: tracks of persons in map, by the name of the body (``person_...``).
    """

    def __init__(
        self,
        setup: Setup,
        cells: Cells,
        start: Pose2,
        people: Mapping[str, Track] | None = None,
        changes: dict[str, object] | None = None,
    ) -> None:
        self.requested = Twist2(0.0, 0.0, 0.0)
        self.believed: Pose2 | None = None
        self.follower: RouteFollower | None = None
        super().__init__(setup)
        given = {"start_x_m": start.x, "start_y_m": start.y, "start_yaw_rad": start.yaw, **(changes or {})}
        params = load(LocalizationParams, "ndt_localization", given)
        self.solver = SweepSolver(cells, params.ndt, self.robot.lidar_xyz_m)
        limits = self.robot.empty
        self.map_localizer = MapLocalizer(params, limits.max_speed_mps, limits.max_yaw_rate_radps, self.solver.matcher)
        self.localizer = self.map_localizer
        self._people = dict(people or {})
        lidar = load_lidar_params()
        scene = build_scene(setup.world, lidar, self.sim.world.params.wheelchair, people=self._people)
        self._lidar = Lidar(scene, lidar, self.robot, setup.seed)
        self._track: deque[tuple[float, Array]] = deque(maxlen=round(2.0 * _SWEEP_S / (1e-3 * _TRACK_STEPS)))
        self.fixes: list[Fix] = []
        self._truths: deque[tuple[float, Pose2, float]] = deque(maxlen=200)
        self.lidar_on = True
        self.every(1000.0 / _TRACK_STEPS, self._note_truth)
        self.every(1.0 / _SWEEP_S, self._sweep)

    def settle(self) -> None:
        """Until the start is confirmed. Raises BenchError if it is not."""
        if not self.run(lambda: self.map_localizer.confidence is Confidence.TRACKING, _SETTLE_S):
            raise BenchError(f"the start is not confirmed: {self.map_localizer.estimate(self.time_s)}")

    def _note_truth(self) -> None:
        truth = self.sim.world.truth()
        x, y, z, w = truth.quaternion_xyzw
        pose = np.eye(4)
        pose[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        pose[:3, 3] = truth.position_m
        self._track.append((self.time_s, pose))
        self._truths.append((self.time_s, truth.pose(), truth.position_m[2]))

    def _sweep(self) -> None:
        if not self.lidar_on or len(self._track) < self._track.maxlen:  # type: ignore[operator]
            return
        stamp_s = self._track[-1][0]
        base = Track(np.array([item[0] for item in self._track]), np.array([item[1] for item in self._track]))
        sweep = self._lidar.sweep(base, stamp_s, self._people)

        def deliver() -> None:
            self.map_localizer.on_sweep(sweep.points, stamp_s)
            self._match()

        self.after(_CARRIED_S, deliver)

    def on_odometry(self, stamp_s: float, odometry: Odometry) -> None:
        super().on_odometry(stamp_s, odometry)
        self._match()

    def _match(self) -> None:
        """As the node does: a sweep is matched as soon as odometry has reached its stamp."""
        if not isinstance(self.localizer, MapLocalizer):
            return
        request = self.localizer.request()
        if request is not None:
            answer = self.solver.solve(request)
            self.after(_MATCHED_S, lambda: self.map_localizer.answer(answer, self.time_s))

    def _imu(self, sample: ImuSample) -> None:
        super()._imu(sample)
        x, y, z, w = sample.orientation_xyzw
        up = np.array([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])
        self._send(lambda: self._on_up(up))

    def _on_up(self, up: Array) -> None:
        if isinstance(self.localizer, MapLocalizer):
            self.localizer.on_up(up)

    def _localization_tick(self) -> None:
        super()._localization_tick()
        if not isinstance(self.localizer, MapLocalizer):
            return
        estimate = self.localizer.estimate(self.time_s)
        self.believed = estimate.pose
        _, truth, height = min(self._truths, key=lambda item: abs(item[0] - estimate.stamp_s), default=(0.0, None, 0.0))
        if truth is None:
            return
        score = self.localizer.match.score if self.localizer.match else 0.0
        self.fixes.append(
            Fix(
                self.time_s,
                estimate.pose,
                truth,
                height,
                estimate.quality,
                estimate.position_sigma_m,
                score,
                self.localizer.confidence,
            )
        )

    def _navigation_tick(self) -> None:
        requested = self.requested
        if self.follower is not None and self.believed is not None:
            requested = self.follower.twist(self.believed)
        self._send(lambda: self.drive.on_command(Source.NAVIGATION, requested, self.time_s))


class RouteFollower:
    """Pure pursuit along points (m, map), heading along the way; slow where it bends."""

    def __init__(self, points: Sequence[tuple[float, float]], speed_mps: float, ahead_m: float = 0.6) -> None:
        self._way = _densely(np.array(points, float), 0.1)
        self._speed, self._steps = speed_mps, max(1, round(ahead_m / 0.1))
        self._at = 0

    @property
    def ended(self) -> bool:
        return self._at >= len(self._way) - 3

    def twist(self, pose: Pose2) -> Twist2:
        near = self._way[self._at : self._at + 30]
        self._at += int(np.argmin(np.hypot(near[:, 0] - pose.x, near[:, 1] - pose.y)))
        if self.ended:
            return Twist2(0.0, 0.0, 0.0)
        goal = self._way[min(self._at + self._steps, len(self._way) - 1)]
        far = self._way[min(self._at + 2 * self._steps, len(self._way) - 1)]
        dx, dy = goal[0] - pose.x, goal[1] - pose.y
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        x, y = c * dx + s * dy, -s * dx + c * dy
        heading = math.remainder(math.atan2(far[1] - pose.y, far[0] - pose.x) - pose.yaw, math.tau)
        speed = self._speed * max(0.25, 1.0 - abs(heading) / 0.8)
        distance = max(math.hypot(x, y), 1e-3)
        return Twist2(speed * x / distance, speed * y / distance, max(-0.8, min(0.8, 1.5 * heading)))


def _densely(points: Array, step_m: float) -> Array:
    """(n, 2) points every step_m along the way."""
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    at = np.arange(0.0, lengths[-1], step_m)
    return np.stack([np.interp(at, lengths, points[:, 0]), np.interp(at, lengths, points[:, 1])], axis=1)

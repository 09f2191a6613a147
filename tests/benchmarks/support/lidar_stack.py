"""The stack's kernels with a simulated LiDAR: drive, odometry, localization against a map, and a route follower.

Sweeps are simulated from the true motion. They reach the localizer after the last column and the transport delay, and
matches take their measured time. The robot drives by its estimated pose.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.config import load
from robot_stack.core.geometry import ZERO_TWIST, Pose2
from robot_stack.core.site_map import Cells
from robot_stack.drive.arbitration import Source
from robot_stack.drive.odometry import Odometry
from robot_stack.localization.map_localizer import MapLocalizer
from robot_stack.localization.ndt.gate import Confidence
from robot_stack.localization.ndt.solver import SweepSolver
from robot_stack.localization.params import LocalizationParams
from sim.camera.motion import Track
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import build_scene
from sim.lidar.sensor import Lidar
from sim.mapping.kernel_stack import KernelStack
from sim.plant.imu import ImuSample
from sim.plant.world import Setup
from tests.benchmarks.support.framework import BenchError
from tests.benchmarks.support.lidar_ride import Fix, RouteFollower

Array = NDArray[np.float64]
_TRACK_STEPS = 5
_SWEEP_S = 0.1
_CARRIED_S = 0.015  # from the last column to the node: 3.6 MB are packed, sent and read
_MATCHED_S = 0.010
_SETTLE_S = 3.0


class LidarStack(KernelStack):
    """world: what the sensor sees; setup.world is the world of the physics. start: the localizer's start pose.

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
        self.every(1000.0 / _TRACK_STEPS, self._note_truth)
        self.every(1.0 / _SWEEP_S, self._sweep)

    def settle(self) -> None:
        """Runs until the start is confirmed. On timeout raises BenchError."""
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
        if len(self._track) < self._track.maxlen:  # type: ignore[operator]
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
        """Like the node, matches a sweep as soon as odometry has reached its stamp."""
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
                self.localizer.slip is not None,
            )
        )

    def _navigation_tick(self) -> None:
        requested = ZERO_TWIST
        if self.follower is not None and self.believed is not None:
            requested = self.follower.twist(self.believed)
        self._send(lambda: self.drive.on_command(Source.NAVIGATION, requested, self.time_s))

"""Localization against a map on the deterministic scheduler: drive, LiDAR and localization, driven along routes.

A route follower drives by the pose that the localization publishes, over the teleoperation topic. Figures compare each
estimate with ground truth at its stamp.
"""

from __future__ import annotations

import itertools
import math
import tempfile
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import yaml
from numpy.typing import NDArray

from robot_stack.contract import frames, topics
from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.localization.localizer import Estimate
from robot_stack.localization.ndt.gate import Confidence
from robot_stack.middleware.conversions import twist_stamped
from sim.scheduler.events import NANOSECONDS
from sim.scheduler.observers import LifeChange
from sim.settings import pose_settings
from sim.worldfile import WorldFile
from tests.benchmarks.support.few_nodes import DRIVE, FewNodes
from tests.benchmarks.support.framework import BenchError

Array = NDArray[np.float64]
_SETTLE_S = 3.0
_TRUTHS = 200


@dataclass(frozen=True, slots=True)
class Fix:
    """One estimate of the localization and the truth at its stamp; pose is None while none is published.

    sigma_m: standard deviation of its position, as published. slips: the wheels' way differs from the map's.
    """

    time_s: float
    pose: Pose2 | None
    truth: Pose2
    height_m: float
    quality: float
    sigma_m: float
    score: float
    confidence: Confidence
    slips: bool

    @property
    def error_m(self) -> float:
        return math.inf if self.pose is None else self.pose.distance_to(self.truth)


def way_m(fixes: Sequence[Fix]) -> float:
    """Length of the true way."""
    return sum(a.truth.distance_to(b.truth) for a, b in itertools.pairwise(fixes))


class LidarRide(FewNodes):
    """world: includes its people. site: name or folder of the map. start: the start pose of localization.

    follower: drives the robot if it is set. fixes: one per tick of the localization. localized_from_s: virtual time at
    which the localization became a running node.
    """

    def __init__(self, seed: int, world: WorldFile, site: str, start: Pose2, *settings: str) -> None:
        self._files = tempfile.TemporaryDirectory()
        file = Path(self._files.name) / "world.yaml"
        file.write_text(yaml.safe_dump(world.model_dump(mode="json")), encoding="utf-8")
        own = [f"{node}.world={file}" for node in ("sim_world", "lidar_driver")]
        own += [
            f"ndt_localization.map={site}",
            "sim_world.people=true",
            *pose_settings("ndt_localization.start", start),
        ]
        nodes = (*DRIVE, "lidar_driver")
        super().__init__(seed, nodes, [*own, *settings])
        self.follower: RouteFollower | None = None
        self.fixes: list[Fix] = []
        self.localized_from_s = math.nan
        self._localizer: Any = None
        self._pose: Pose2 | None = None
        self._truths: deque[tuple[float, Pose2, float]] = deque(maxlen=_TRUTHS)

    def __enter__(self) -> Self:
        super().__enter__()
        self.publish(topics.TELEOP_CMD_VEL, twist_stamped(ZERO_TWIST, frames.BASE_LINK, self.stamp()))
        self.scheduler.every(round(NANOSECONDS / topics.TELEOP_CMD_VEL.nominal_rate_hz), self._drive)
        self.run(lambda: self.confidence is Confidence.TRACKING, _SETTLE_S, "the start is not confirmed")
        return self

    def on_life_change(self, time_ns: int, process: str, change: LifeChange) -> None:
        super().on_life_change(time_ns, process, change)
        if change is LifeChange.READY and process == "sim_world":
            assert self.world is not None
            self.world.after_block.append(self._note_truth)
        elif change is LifeChange.READY and process == "ndt_localization":
            self._localizer, self.localized_from_s = self.node(process).localizer, self.time_s
            estimate = self._localizer.estimate

            def noted(now_s: float) -> Estimate:
                found: Estimate = estimate(now_s)
                self._note_fix(found)
                return found

            self._localizer.estimate = noted

    def __exit__(self, *arguments: object) -> None:
        super().__exit__(*arguments)
        self._files.cleanup()

    def run(self, condition: Callable[[], bool], limit_s: float, otherwise: str) -> None:
        """Runs until the condition holds. On timeout raises BenchError with the text ``otherwise``."""
        if not self.scheduler.run_for(limit_s, condition):
            raise BenchError(f"{otherwise} after {limit_s:.0f} s; robot at {self.truth()[0]}")

    @property
    def confidence(self) -> Confidence | None:
        return self.fixes[-1].confidence if self.fixes else None

    def _note_truth(self) -> None:
        truth = self.physics.truth()
        self._truths.append((self._ros_s(), truth.pose(), truth.position_m[2]))

    def _note_fix(self, estimate: Estimate) -> None:
        localizer = self._localizer
        self._pose = estimate.pose
        if not self._truths:
            return
        _, truth, height_m = min(self._truths, key=lambda item: abs(item[0] - estimate.stamp_s))
        self.fixes.append(
            Fix(
                self.time_s,
                estimate.pose,
                truth,
                height_m,
                estimate.quality,
                estimate.position_sigma_m,
                localizer.match.score if localizer.match else 0.0,
                localizer.confidence,
                localizer.slip is not None,
            )
        )

    def _drive(self) -> None:
        follower, pose = self.follower, self._pose
        twist = ZERO_TWIST if follower is None or pose is None else follower.twist(pose)
        self.publish(topics.TELEOP_CMD_VEL, twist_stamped(twist, frames.BASE_LINK, self.stamp()))

    def _ros_s(self) -> float:
        return self.operator.port.now_ns() / NANOSECONDS


class RouteFollower:
    """Pure pursuit along points (m, map) with the heading along the path; slows down in bends."""

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
    """(n, 2) points every step_m along the path."""
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    at = np.arange(0.0, lengths[-1], step_m)
    return np.stack([np.interp(at, lengths, points[:, 0]), np.interp(at, lengths, points[:, 1])], axis=1)

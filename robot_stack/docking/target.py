"""The dock's pose in odom: sightings and odometry fused, with the images' true delay."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum

from robot_stack.core.geometry import Pose2, wrap_angle
from robot_stack.docking.params import TargetParams
from robot_stack.docking.sighting import Sighting


class Seen(Enum):
    """Classification of a sighting."""

    ACCEPTED = "accepted"
    JUMPED = "refused: it jumps against odometry"
    MOVED = "the dock has moved"


@dataclass(frozen=True, slots=True)
class Estimate:
    """The dock in odom, with standard deviations."""

    pose: Pose2
    sigma_m: float
    sigma_rad: float


class DockTarget:
    """A Kalman filter of a pose that is constant in odom, while odom drifts with the distance travelled.

    The same deviation holds for x and y, so that three scalars are the whole filter.
    """

    def __init__(self, params: TargetParams) -> None:
        self._params = params
        self.forget()

    def forget(self) -> None:
        """Nothing is known of the dock."""
        self._pose: Pose2 | None = None
        self._variance_m2 = self._params.start_sigma_m**2
        self._variance_rad2 = self._params.start_sigma_rad**2
        self._refused: deque[Pose2] = deque(maxlen=self._params.moved_after)

    @property
    def estimate(self) -> Estimate | None:
        if self._pose is None:
            return None
        return Estimate(self._pose, math.sqrt(self._variance_m2), math.sqrt(self._variance_rad2))

    def drive(self, step: Pose2) -> None:
        """Adds the variance of a motion by ``step``, in the robot's own frame."""
        p, distance_m, turn_rad = self._params, math.hypot(step.x, step.y), abs(step.yaw)
        self._variance_m2 += p.odometry_m_per_sqrt_m**2 * distance_m
        self._variance_rad2 += p.odometry_rad_per_sqrt_m**2 * distance_m + p.odometry_rad_per_sqrt_rad**2 * turn_rad

    def see(self, sighting: Sighting, base_in_odom: Pose2) -> Seen:
        """Adds a sighting; ``base_in_odom`` is the robot's pose at the sighting's stamp."""
        measured = base_in_odom.compose(sighting.dock)
        if self._pose is None:
            self._take(measured, sighting)
            return Seen.ACCEPTED
        jump = measured.relative_to(self._pose)
        turned = sighting.yaw_known and self._yaw_known() and abs(jump.yaw) > self._params.jump_rad
        if math.hypot(jump.x, jump.y) > self._params.jump_m or turned:
            return self._refuse(measured)
        self._refused.clear()
        self._correct(measured, sighting)
        return Seen.ACCEPTED

    def _yaw_known(self) -> bool:
        return self._variance_rad2 < self._params.jump_rad**2

    def _take(self, measured: Pose2, sighting: Sighting) -> None:
        p = self._params
        self._pose = measured
        self._variance_m2 = max(sighting.sigma_m, p.least_sigma_m) ** 2
        self._variance_rad2 = self._yaw_variance(sighting) if sighting.yaw_known else p.start_sigma_rad**2

    def _correct(self, measured: Pose2, sighting: Sighting) -> None:
        assert self._pose is not None
        p, pose = self._params, self._pose
        noise_m2 = max(sighting.sigma_m, p.least_sigma_m) ** 2
        gain = max(self._variance_m2 / (self._variance_m2 + noise_m2), p.least_gain)
        x, y = pose.x + gain * (measured.x - pose.x), pose.y + gain * (measured.y - pose.y)
        self._variance_m2 = _updated(self._variance_m2, noise_m2, gain)
        yaw = pose.yaw
        if sighting.yaw_known:
            noise_rad2 = self._yaw_variance(sighting)
            gain = max(self._variance_rad2 / (self._variance_rad2 + noise_rad2), p.least_gain)
            yaw = wrap_angle(yaw + gain * wrap_angle(measured.yaw - yaw))
            self._variance_rad2 = _updated(self._variance_rad2, noise_rad2, gain)
        self._pose = Pose2(x, y, yaw)

    def _yaw_variance(self, sighting: Sighting) -> float:
        p = self._params
        return max(p.yaw_sigma_radpm * sighting.sigma_m, p.least_sigma_rad) ** 2

    def _refuse(self, measured: Pose2) -> Seen:
        """Collects outliers: sightings that jump but agree with each other show a moved dock, not detector errors."""
        self._refused.append(measured)
        if len(self._refused) < self._params.moved_after:
            return Seen.JUMPED
        spread_m = max(pose.distance_to(measured) for pose in self._refused)
        return Seen.MOVED if spread_m <= self._params.moved_spread_m else Seen.JUMPED


def _updated(variance: float, noise: float, gain: float) -> float:
    """Variance after a correction with any gain (Joseph's form)."""
    return (1.0 - gain) ** 2 * variance + gain**2 * noise

"""The localization kernel: computes the pose in map and its quality from odometry and IMU.

Times of data are stamps on the ROS clock; ages are taken on the steady clock at reception, which the caller passes in.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.core.pose_history import PoseHistory
from robot_stack.localization.filter import Array, PoseFilter, Step
from robot_stack.localization.gyro import GyroIncrement, GyroIntegrator, ImuSample
from robot_stack.localization.history import NO_DOUBT, Correction, DelayedFilter
from robot_stack.localization.odometry import Increment, OdometryEvent, OdometryIncrements, OdometryReading, Variances
from robot_stack.localization.params import LocalizationParams
from robot_stack.localization.quality import quality
from robot_stack.localization.standstill import Standstill

# Indices of x, y and yaw in a message's covariance of six.
PLANAR = (0, 1, 5)
# Events worth logging; the others are ordinary.
_NOTABLE = (OdometryEvent.RESTARTED, OdometryEvent.CLOCK_RESTARTED)


@dataclass(frozen=True, slots=True)
class Estimate:
    """The estimate at one moment.

    pose: base_link in map, None while it must not be published. stamp_s: time of the newest data in it.
    covariance: (3, 3) of x, y, yaw in map, m2, m rad, rad2.
    map_to_odom: pose of the odom frame in map, at the same time. faults: what is wrong with the inputs, for people.
    """

    pose: Pose2 | None
    stamp_s: float
    map_to_odom: Pose2 | None
    quality: float
    covariance: Array
    position_sigma_m: float
    yaw_sigma_rad: float
    gyro_bias_radps: float
    gyro_used: bool
    standing: bool
    faults: tuple[str, ...]


class Localizer:
    """Fuses increments of wheel odometry with the yaw gyro from a given start pose; accepts corrections by poses.

    max_speed_mps, max_yaw_rate_radps: limits of the robot, ``config/robot.yaml``.
    """

    def __init__(self, params: LocalizationParams, max_speed_mps: float, max_yaw_rate_radps: float) -> None:
        self._params = params
        self._odometry = OdometryIncrements(params.odometry, max_speed_mps, max_yaw_rate_radps)
        self._gyro = GyroIntegrator(params.gyro)
        self._standstill = Standstill(params.standstill)
        start = Pose2(params.start_x_m, params.start_y_m, params.start_yaw_rad)
        g = params.gyro
        self._pose_filter = PoseFilter(
            start, self.start_covariance(), g.bias_sigma_radps, g.bias_walk_radps_per_sqrt_s, g.disagreement_sigmas
        )
        self._filter = DelayedFilter(self._pose_filter, params.history_s)
        self._odometry_pose: Pose2 | None = None
        self._odometry_received_s = -math.inf
        self._gyro_used = False
        self._standing = False
        self._odometry_fault = ""
        self._imu_fault = ""
        self._slipping = False
        # Dead-reckoned path of base_link by wheels and gyro: without jumps by corrections.
        self.travelled = PoseHistory(params.history_s)

    def start_covariance(self) -> Array:
        """(3, 3) covariance of x, y, yaw of a manually given pose."""
        p = self._params
        return np.diag([p.start_position_sigma_m**2, p.start_position_sigma_m**2, p.start_yaw_sigma_rad**2])

    def on_imu(self, sample: ImuSample) -> None:
        self._imu_fault = self._gyro.add(sample)

    def on_odometry(self, reading: OdometryReading, received_s: float) -> OdometryEvent:
        """Predicts up to ``reading``. received_s: steady time of its reception."""
        increment = self._odometry.take(reading)
        self._odometry_fault = reading.problem()
        if increment.event in (OdometryEvent.UNUSABLE, OdometryEvent.LATE):
            return increment.event
        self._odometry_received_s = received_s
        self._odometry_pose = reading.pose
        if increment.event is OdometryEvent.CLOCK_RESTARTED:
            self._gyro.clear()
        gyro = self._gyro.take(reading.stamp_s)
        if increment.event is OdometryEvent.MOTION:
            self._predict(increment, gyro)
        else:
            self._hold(increment)
        if increment.event in _NOTABLE:
            self._odometry_fault = f"/odom: {increment.event.value}"
        return increment.event

    def correct(self, pose: Pose2, covariance: Array, stamp_s: float, doubt: Variances = NO_DOUBT) -> Correction:
        """Corrects by a measured pose of base_link in map, (3, 3) covariance, at ``stamp_s``.

        doubt: see :meth:`DelayedFilter.correct`.
        """
        if not (pose.is_finite() and math.isfinite(stamp_s) and usable_covariance(covariance)):
            return Correction.NOT_FINITE
        return self._filter.correct(pose, covariance, stamp_s, self._params.correction_gate_sigmas, doubt)

    def reset(self, pose: Pose2, covariance: Array, stamp_s: float) -> None:
        """Restarts from a given pose: without a gate, and with the motion since ``stamp_s`` added if known.

        Raises ValueError for a pose or covariance that cannot be used.
        """
        if not pose.is_finite():
            raise ValueError(f"pose is not finite: {pose}")
        if not usable_covariance(covariance):
            raise ValueError("covariance is not a finite positive definite 3 x 3 matrix")
        then = self._filter.pose_at(stamp_s)
        now = pose if then is None else pose.compose(self._filter.state().pose.relative_to(then))
        self._pose_filter.set_pose(now, covariance)
        if not math.isnan(self._filter.stamp_s):
            self._filter.start(self._filter.stamp_s)

    def estimate(self, steady_s: float) -> Estimate:
        """The pose at the time of the newest data. steady_s: the steady clock now."""
        state = self._filter.state()
        age_s = steady_s - self._odometry_received_s
        silent = not 0.0 <= age_s <= self._params.quality.odometry_silent_s
        known = not silent and self._odometry_pose is not None
        value = quality(state.position_sigma_m, state.yaw_sigma_rad, age_s, self._gyro_used, self._params.quality)
        return Estimate(
            pose=state.pose if known else None,
            stamp_s=self._filter.stamp_s,
            map_to_odom=state.pose.compose(self._odometry_pose.inverse()) if known and self._odometry_pose else None,
            quality=value if known else 0.0,
            covariance=state.pose_covariance,
            position_sigma_m=state.position_sigma_m,
            yaw_sigma_rad=state.yaw_sigma_rad,
            gyro_bias_radps=state.bias_radps,
            gyro_used=self._gyro_used,
            standing=self._standing,
            faults=self._faults(age_s),
        )

    def _predict(self, increment: Increment, gyro: GyroIncrement | None) -> None:
        self._standing = self._standstill.step(increment.motion, increment.dt_s, gyro)
        variance = (0.0, 0.0, 0.0) if self._standing else increment.variance
        step = Step(increment.stamp_s, increment.dt_s, increment.motion, variance, gyro, self._standing)
        before, gone = self._filter.state().pose, self.travelled.newest
        self._slipping = self._filter.predict(step)
        moved = self._filter.state().pose.relative_to(before)
        self.travelled.add(increment.stamp_s, (gone.pose if gone else IDENTITY).compose(moved))
        self._gyro_used = gyro is not None

    def _hold(self, increment: Increment) -> None:
        self._standing = False
        self._standstill.clear()
        self.travelled.clear()
        self.travelled.add(increment.stamp_s, IDENTITY)
        self._pose_filter.grow(increment.variance)
        self._filter.start(increment.stamp_s)

    def _faults(self, odometry_age_s: float) -> tuple[str, ...]:
        faults = [self._odometry_fault, self._imu_fault]
        if not odometry_age_s <= self._params.quality.odometry_fresh_s:
            faults.append("/odom silent" if math.isfinite(odometry_age_s) else "/odom never received")
        elif not self._gyro_used and not self._imu_fault:
            faults.append("/sensors/imu missing: yaw from the wheels alone")
        if self._slipping:
            faults.append("wheels and gyro disagree: slip")
        return tuple(fault for fault in faults if fault)


def usable_covariance(covariance: Array) -> bool:
    """True for a finite, symmetric, positive definite (3, 3) matrix."""
    if covariance.shape != (3, 3) or not np.isfinite(covariance).all() or not np.allclose(covariance, covariance.T):
        return False
    return bool(np.linalg.eigvalsh(covariance)[0] > 0.0)


def planar_covariance(covariance: Sequence[float]) -> Array:
    """(3, 3) of x, y, yaw out of the (6, 6), row by row, of x, y, z, roll, pitch, yaw."""
    return np.asarray(covariance, dtype=np.float64).reshape(6, 6)[np.ix_(PLANAR, PLANAR)]

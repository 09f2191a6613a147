"""Extended Kalman filter of the planar pose with the bias of the yaw gyro.

State: x, y (m, map), yaw (rad, map), gyro bias (rad/s), and the yaw increment of the current step (rad). The increment
is a state for one step only: odometry gives it a value and a variance, the gyro measures increment plus bias, and so
wheels, gyro and bias share the correction by their variances before the pose is predicted. While the robot stands, the
wheels alone give the increment, and the gyro measures only its bias (zero-velocity update).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from filterpy.kalman import ExtendedKalmanFilter

from robot_stack.core.geometry import Pose2, wrap_angle
from robot_stack.localization.gyro import GyroIncrement
from robot_stack.localization.odometry import Variances

Array = npt.NDArray[np.float64]
_X, _Y, _YAW, _BIAS, _STEP = range(5)
_POSE = slice(0, 3)
# Yaw error of a standing robot's wheels in one step, rad: below any encoder's resolution.
_STANDING_SIGMA_RAD = 1e-6


@dataclass(frozen=True, slots=True)
class Step:
    """One prediction: motion of base_link in its own frame at the beginning of the step.

    variance: of the motion (x, y, yaw), m2, m2, rad2.
    gyro is None where no gyro covers the step; standing is True if the robot is known to stand.
    """

    stamp_s: float
    dt_s: float
    motion: Pose2
    variance: Variances
    gyro: GyroIncrement | None
    standing: bool = False

    def part(self, share: float) -> Step:
        """The first ``share`` (0..1) of the step. Linear: over 20 ms at 1 m/s and 1 rad/s the chord errs by 50 um."""
        return self._scaled(share, self.stamp_s - (1.0 - share) * self.dt_s)

    def rest(self, share: float) -> Step:
        """The remainder of the step after :meth:`part`, in the frame at its own beginning."""
        left = self._scaled(1.0 - share, self.stamp_s)
        return replace(left, motion=self.motion.relative_to(self.part(share).motion))

    def _scaled(self, share: float, stamp_s: float) -> Step:
        m, v, g = self.motion, self.variance, self.gyro
        return Step(
            stamp_s,
            share * self.dt_s,
            Pose2(share * m.x, share * m.y, share * m.yaw),
            (share * v[0], share * v[1], share * v[2]),
            None if g is None else GyroIncrement(share * g.angle_rad, share * g.variance_rad2),
            self.standing,
        )


@dataclass(frozen=True, slots=True)
class FilterState:
    """A copy of the filter's state: mean (5) and covariance (5, 5)."""

    mean: Array
    covariance: Array

    @property
    def pose(self) -> Pose2:
        return Pose2(float(self.mean[_X]), float(self.mean[_Y]), wrap_angle(float(self.mean[_YAW])))

    @property
    def bias_radps(self) -> float:
        return float(self.mean[_BIAS])

    @property
    def bias_sigma_radps(self) -> float:
        return math.sqrt(float(self.covariance[_BIAS, _BIAS]))

    @property
    def pose_covariance(self) -> Array:
        """(3, 3) covariance of x, y, yaw in map, m2, m rad, rad2."""
        return self.covariance[_POSE, _POSE].copy()

    @property
    def position_sigma_m(self) -> float:
        """Standard deviation of the position along its worst direction, m."""
        return math.sqrt(max(0.0, float(np.linalg.eigvalsh(self.covariance[:2, :2])[-1])))

    @property
    def yaw_sigma_rad(self) -> float:
        return math.sqrt(max(0.0, float(self.covariance[_YAW, _YAW])))

    def is_finite(self) -> bool:
        return bool(np.isfinite(self.mean).all() and np.isfinite(self.covariance).all())


class _Ekf(ExtendedKalmanFilter):  # type: ignore[misc]
    """filterpy's filter with the motion model: the pose advances by (dx, dy, yaw increment)."""

    x: Array
    P: Array
    F: Array
    Q: Array

    def predict_x(self, u: Any = 0) -> None:
        dx, dy = u
        c, s = math.cos(self.x[_YAW]), math.sin(self.x[_YAW])
        self.F = np.eye(5)
        self.F[_X, _YAW] = -s * dx - c * dy
        self.F[_Y, _YAW] = c * dx - s * dy
        self.F[_YAW, _STEP] = 1.0
        self.F[_STEP, _STEP] = 0.0
        step_rad = self.x[_STEP]
        self.x = self.x + np.array([c * dx - s * dy, s * dx + c * dy, step_rad, 0.0, -step_rad])


class PoseFilter:
    """Prediction by odometry and gyro, correction by poses.

    bias_sigma_radps: standard deviation of the gyro's bias at the start; bias_walk: rad/s per sqrt(s).
    disagreement_sigmas: wheels that differ from the gyro by more standard deviations are assumed to slip.
    """

    def __init__(
        self,
        start: Pose2,
        start_covariance: Array,
        bias_sigma_radps: float,
        bias_walk_radps_per_sqrt_s: float,
        disagreement_sigmas: float,
    ) -> None:
        self._bias_walk = bias_walk_radps_per_sqrt_s
        self._disagreement_sigmas = disagreement_sigmas
        self._ekf = _Ekf(dim_x=5, dim_z=1)
        self._ekf.x = np.zeros(5)
        self._ekf.P = np.zeros((5, 5))
        self._ekf.P[_BIAS, _BIAS] = bias_sigma_radps**2
        self.set_pose(start, start_covariance)

    def state(self) -> FilterState:
        return FilterState(self._ekf.x.copy(), self._ekf.P.copy())

    def restore(self, state: FilterState) -> None:
        self._ekf.x, self._ekf.P = state.mean.copy(), state.covariance.copy()

    def set_pose(self, pose: Pose2, covariance: Array) -> None:
        """Restarts from a pose with a (3, 3) covariance; the bias estimate stays."""
        self._ekf.x[_POSE] = pose.x, pose.y, pose.yaw
        self._ekf.P[_POSE, :] = 0.0
        self._ekf.P[:, _POSE] = 0.0
        self._ekf.P[_POSE, _POSE] = covariance

    def grow(self, variance: Variances) -> None:
        """Adds uncertainty without motion: (x, y, yaw), m2, m2, rad2."""
        self._ekf.P[_POSE, _POSE] += np.diag(variance)

    def predict(self, step: Step) -> bool:
        """Predicts the pose. Returns True if gyro and wheels differ so much that the wheels are assumed to slip."""
        ekf = self._ekf
        ekf.P[_BIAS, _BIAS] += self._bias_walk**2 * step.dt_s
        ekf.x[_STEP] = step.motion.yaw
        ekf.P[_STEP, :] = 0.0
        ekf.P[:, _STEP] = 0.0
        ekf.P[_STEP, _STEP] = _STANDING_SIGMA_RAD**2 if step.standing else step.variance[2]
        slipped = step.gyro is not None and self._measure_turn(step.gyro, step.dt_s)
        self._move(step)
        return slipped

    def correct(self, pose: Pose2, covariance: Array, gate_sigmas: float) -> bool:
        """Corrects by a pose in map, (3, 3) covariance. False if it is outside the gate: then nothing changed."""
        ekf = self._ekf
        h = np.eye(3, 5)
        innovation = np.array([pose.x - ekf.x[_X], pose.y - ekf.x[_Y], wrap_angle(pose.yaw - ekf.x[_YAW])])
        spread = ekf.P[_POSE, _POSE] + covariance
        if float(innovation @ np.linalg.solve(spread, innovation)) > gate_sigmas**2:
            return False
        # The innovation is wrapped above, so it is passed as a measurement of zero.
        ekf.update(innovation, lambda _: h, lambda _: np.zeros(3), R=covariance)
        return True

    def _measure_turn(self, gyro: GyroIncrement, dt_s: float) -> bool:
        ekf = self._ekf
        h = np.array([[0.0, 0.0, 0.0, dt_s, 1.0]])
        innovation = gyro.angle_rad - ekf.x[_STEP] - ekf.x[_BIAS] * dt_s
        spread = float((h @ ekf.P @ h.T)[0, 0]) + gyro.variance_rad2
        slipped = innovation**2 > self._disagreement_sigmas**2 * spread
        if slipped:  # the gyro's scatter is in its variance: the rest is wheel slip
            ekf.P[_STEP, _STEP] += innovation**2
        ekf.update(np.array([innovation]), lambda _: h, lambda _: np.zeros(1), R=np.array([[gyro.variance_rad2]]))
        return bool(slipped)

    def _move(self, step: Step) -> None:
        ekf = self._ekf
        c, s = math.cos(ekf.x[_YAW]), math.sin(ekf.x[_YAW])
        turn = np.array([[c, -s], [s, c]])
        ekf.Q = np.zeros((5, 5))
        ekf.Q[:2, :2] = turn @ np.diag(step.variance[:2]) @ turn.T
        ekf.predict((step.motion.x, step.motion.y))
        ekf.x[_YAW] = wrap_angle(float(ekf.x[_YAW]))

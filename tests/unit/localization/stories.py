"""A simulated robot with wheels and a gyro, in fake time."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from robot_stack.core.config import load
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2, exp_se2
from robot_stack.localization.gyro import ImuSample
from robot_stack.localization.localizer import Localizer
from robot_stack.localization.odometry import OdometryReading
from robot_stack.localization.params import LocalizationParams

ODOM_S, IMU_S = 0.02, 0.01
PERFECT = (1e-8, 1e-8, 1e-8)


def params(**overrides: object) -> LocalizationParams:
    return load(LocalizationParams, "ndt_localization", overrides)


def reading(stamp_s: float, pose: Pose2 = IDENTITY, twist: Twist2 = ZERO_TWIST, **changes: object) -> OdometryReading:
    values = {"pose_variance": PERFECT, "twist_variance": PERFECT, **changes}
    return OdometryReading(stamp_s, pose, twist, **values)  # type: ignore[arg-type]


@dataclass
class Story:
    """Drives a true pose by twists. Wheels and gyro report it, each with its own errors, to a localizer.

    wheel_scale: share of the true turn rate that the wheels report. bias_radps, noise_radps: errors of the gyro.
    """

    localizer: Localizer
    bias_radps: float = 0.0
    noise_radps: float = 0.0
    wheel_scale: float = 1.0
    twist_variance: tuple[float, float, float] = PERFECT
    imu_on: bool = True
    odometry_on: bool = True
    begun: bool = False
    t_s: float = 100.0
    truth: Pose2 = IDENTITY
    wheels: Pose2 = IDENTITY
    random: np.random.Generator = field(default_factory=lambda: np.random.default_rng(5))

    def drive(self, twist: Twist2, seconds: float) -> Story:
        if not self.begun:  # the first reading is taken at rest at the start pose
            self.localizer.on_odometry(self.odometry(ZERO_TWIST), self.t_s)
            self.begun = True
        for _ in range(round(seconds / IMU_S)):
            self._half_step(twist)
        return self

    def _half_step(self, twist: Twist2) -> None:
        self.t_s += IMU_S
        self.truth = self.truth.compose(exp_se2(twist, IMU_S))
        seen = Twist2(twist.vx, twist.vy, twist.omega * self.wheel_scale)
        self.wheels = self.wheels.compose(exp_se2(seen, IMU_S))
        if self.imu_on:
            rate = twist.omega + self.bias_radps + self.noise_radps * self.random.standard_normal()
            self.localizer.on_imu(ImuSample(self.t_s, rate, (rate, self.t_s)))
        if self.odometry_on and round(self.t_s / IMU_S) % 2 == 0:
            self.localizer.on_odometry(self.odometry(seen), self.t_s)

    def odometry(self, twist: Twist2) -> OdometryReading:
        return reading(self.t_s, self.wheels, twist, twist_variance=self.twist_variance)

    def error_m(self) -> float:
        return self.localizer.estimate(self.t_s).pose.distance_to(self.truth)  # type: ignore[union-attr]

    def yaw_error_rad(self) -> float:
        pose = self.localizer.estimate(self.t_s).pose
        return abs(math.remainder(pose.yaw - self.truth.yaw, 2.0 * math.pi))


def story(**changes: object) -> Story:
    overrides = changes.pop("params", {})
    localizer = Localizer(params(**overrides), max_speed_mps=1.5, max_yaw_rate_radps=1.0)  # type: ignore[arg-type]
    return Story(localizer, **changes)  # type: ignore[arg-type]

"""The inertial unit: measurements of the true motion by a MEMS unit on a small vehicle.

Each sample is the average of the true acceleration (gravity included) and rotation over the sample's period, plus
white noise and a bias that walks. The orientation emulates the unit's complementary filter: the true attitude with an
error of roll and pitch that wanders (first-order Gauss-Markov) and a heading that starts at zero and drifts, because
without a magnetometer there is no reference to north.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import yaw_from_quaternion
from sim.params import Imu

Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class ImuSample:
    """One sample in the unit's frame: m/s2 with gravity, rad/s, orientation x y z w; ``time_s`` is the period's end."""

    time_s: float
    acceleration_mps2: tuple[float, float, float]
    rotation_radps: tuple[float, float, float]
    orientation_xyzw: Quaternion


class ImuModel:
    """Call ``measure`` every step; ``sample`` returns the sample that the unit sends at that moment.

    inclination_wxyz: turns the frame that orientations are given in into one whose z is upright.
    """

    def __init__(
        self,
        params: Imu,
        period_steps: int,
        dt_s: float,
        random: np.random.Generator,
        inclination_wxyz: Quaternion = (1.0, 0.0, 0.0, 0.0),
    ) -> None:
        self._params = params
        self._period_steps = period_steps
        self._period_s = period_steps * dt_s
        self._dt_s = dt_s
        self._random = random
        self._inclination = inclination_wxyz
        self._sum = np.zeros(6)
        self._count = 0
        self._noise = np.array([params.accelerometer_noise_mps2] * 3 + [params.gyroscope_noise_radps] * 3)
        walk = [params.accelerometer_bias_walk_mps2_per_sqrt_s] * 3 + [params.gyroscope_bias_walk_radps_per_sqrt_s] * 3
        self._bias_walk = math.sqrt(self._period_s) * np.array(walk)
        self._bias = np.concatenate(
            [
                params.accelerometer_bias_mps2 * random.standard_normal(3),
                params.gyroscope_bias_radps * random.standard_normal(3),
            ]
        )
        self._attitude_error = params.attitude_error_rad * random.standard_normal(2)
        self._heading_error = 0.0
        self._heading_at_start: float | None = None
        self._waiting: deque[ImuSample] = deque()
        self._last: ImuSample | None = None
        self.silent = False
        self.frozen = False
        self.noise_factor = 1.0

    def measure(self, time_s: float, readings: NDArray[np.float64], orientation_wxyz: NDArray[np.float64]) -> None:
        """One physics step: readings (6,) are acceleration m/s2 and rotation rad/s in the unit's frame."""
        self._sum += readings
        self._count += 1
        if self._count >= self._period_steps:
            self._waiting.append(self._take(time_s, orientation_wxyz))
            self._sum[:] = 0.0
            self._count = 0

    def sample(self, time_s: float) -> ImuSample | None:
        """The sample that leaves the unit at ``time_s``, if one does."""
        if not self._waiting or time_s + 1e-9 < self._waiting[0].time_s + self._params.latency_s:
            return None
        sample = self._waiting.popleft()
        if self.frozen and self._last is not None:
            sample = replace(self._last, time_s=sample.time_s)  # a frozen unit repeats its sample with new stamps
        self._last = sample
        return None if self.silent else sample

    def _take(self, time_s: float, orientation_wxyz: NDArray[np.float64]) -> ImuSample:
        self._walk()
        noise = self.noise_factor * self._noise * self._random.standard_normal(6)
        values = (self._sum / self._count + self._bias + noise).tolist()
        return ImuSample(
            time_s,
            (values[0], values[1], values[2]),
            (values[3], values[4], values[5]),
            self._orientation(orientation_wxyz),
        )

    def _walk(self) -> None:
        params, root = self._params, math.sqrt(self._period_s)
        walk = self._random.standard_normal(9)
        self._bias += self._bias_walk * walk[:6]
        keep = math.exp(-self._period_s / params.attitude_error_time_s)
        drive = params.attitude_error_rad * math.sqrt(1.0 - keep * keep)
        self._attitude_error = keep * self._attitude_error + drive * walk[6:8]
        self._heading_error += params.heading_walk_rad_per_sqrt_s * root * float(walk[8])

    def _orientation(self, wxyz: NDArray[np.float64]) -> Quaternion:
        w, x, y, z = wxyz.tolist()
        if self._inclination[0] != 1.0:
            w, x, y, z = _product(self._inclination, (w, x, y, z))
        if self._heading_at_start is None:
            self._heading_at_start = yaw_from_quaternion(x, y, z, w)
        turn = 0.5 * (self._heading_error - self._heading_at_start)
        leveled = _product((math.cos(turn), 0.0, 0.0, math.sin(turn)), (w, x, y, z))
        roll, pitch = self._attitude_error.tolist()
        tilt = 0.5 * math.hypot(roll, pitch)
        scale = 0.5 * math.sin(tilt) / tilt if tilt > 0.0 else 0.5
        w, x, y, z = _product(leveled, (math.cos(tilt), scale * roll, scale * pitch, 0.0))
        return x, y, z, w


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product, w x y z."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )

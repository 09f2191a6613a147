"""Detection of standstill: only then the gyro's reading is its bias."""

from __future__ import annotations

import math

from robot_stack.core.geometry import Pose2
from robot_stack.localization.gyro import GyroIncrement
from robot_stack.localization.params import StandstillParams


class Standstill:
    """True once wheels and gyro have both been quiet for ``after_s``."""

    def __init__(self, params: StandstillParams) -> None:
        self._params = params
        self._quiet_s = 0.0

    def step(self, motion: Pose2, dt_s: float, gyro: GyroIncrement | None) -> bool:
        """One step of odometry: motion of base_link in ``dt_s`` > 0, and the turn by the gyro, bias included."""
        p = self._params
        rolling = math.hypot(motion.x, motion.y) > p.max_speed_mps * dt_s
        steering = abs(motion.yaw) > p.max_yaw_rate_radps * dt_s
        # Wheels at rest are not enough: a person may turn the whole robot, sliding, and that is not bias.
        turning = gyro is not None and abs(gyro.angle_rad) > p.max_gyro_radps * dt_s
        self._quiet_s = 0.0 if rolling or steering or turning else self._quiet_s + dt_s
        return self._quiet_s >= p.after_s

    def clear(self) -> None:
        self._quiet_s = 0.0

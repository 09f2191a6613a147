"""Speed and motion limits exchanged by planning, drive and safety monitor."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_stack.contract.faults import stops_gently
from robot_stack.core.robot import Motion


@dataclass(frozen=True, slots=True)
class SpeedLimit:
    """Largest speed (norm of the planar velocity, m/s) and yaw rate (rad/s), as in ``/safety/velocity_limit``.

    NaN and negative values count as 0 (``usable``), +inf is no limit.
    """

    linear_mps: float
    angular_radps: float

    def usable(self) -> tuple[float, float]:
        """(speed m/s, yaw rate rad/s), both >= 0."""
        return _usable(self.linear_mps), _usable(self.angular_radps)

    def slower(self, other: SpeedLimit) -> SpeedLimit:
        """The lower of both, usable."""
        return SpeedLimit(*map(min, self.usable(), other.usable()))


@dataclass(frozen=True, slots=True)
class SafetyLimit(SpeedLimit):
    """The safety monitor's limit, as in ``/safety/velocity_limit``.

    codes: faults and other reasons that it stems from (``robot_stack.contract.faults``); none = the robot's own limits.
    """

    codes: tuple[str, ...] = ()

    def is_hard_stop(self) -> bool:
        """True for a limit of zero or NaN, unless every code permits a gentle stop."""
        return self.usable()[0] == 0.0 and not stops_gently(self.codes)


STANDSTILL = SpeedLimit(0.0, 0.0)
NO_LIMIT = SpeedLimit(math.inf, math.inf)


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Bounds of the translation (norm of the planar vector) and of the yaw: m and rad, s.

    Speeds may be 0: stop. Raises ValueError for anything else that is not positive and finite.
    """

    speed_mps: float
    yaw_rate_radps: float
    acceleration_mps2: float
    yaw_acceleration_radps2: float
    jerk_mps3: float
    yaw_jerk_radps3: float

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            may_be_zero = name in ("speed_mps", "yaw_rate_radps")
            if not (math.isfinite(value) and (value > 0.0 or (may_be_zero and value == 0.0))):
                raise ValueError(f"motion limit {name} must be positive and finite, is {value}")

    @classmethod
    def of(cls, motion: Motion) -> MotionLimits:
        """The limits of ``config/robot.yaml``."""
        return cls(
            motion.max_speed_mps,
            motion.max_yaw_rate_radps,
            motion.max_acceleration_mps2,
            motion.max_yaw_acceleration_radps2,
            motion.max_jerk_mps3,
            motion.max_yaw_jerk_radps3,
        )

    def slower(self, limit: SpeedLimit) -> MotionLimits:
        """These limits with lower speeds, where the given ones are lower."""
        speed_mps, yaw_rate_radps = limit.usable()
        return MotionLimits(
            min(self.speed_mps, speed_mps),
            min(self.yaw_rate_radps, yaw_rate_radps),
            self.acceleration_mps2,
            self.yaw_acceleration_radps2,
            self.jerk_mps3,
            self.yaw_jerk_radps3,
        )


def _usable(limit: float) -> float:
    return limit if limit > 0.0 else 0.0  # also for NaN, which is not greater than anything

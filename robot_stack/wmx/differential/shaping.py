"""Converts the commanded twist to wheel speeds, within acceleration and jerk limits of the body.

Without limits the engine shapes a change by itself, in the documented acc_time and dec_time. With limits each tick
gives a step towards the commanded speeds, and the engine only smooths between the steps.
"""

from __future__ import annotations

from dataclasses import dataclass

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.core.limits import MotionLimits
from robot_stack.core.twist_limits import approach
from robot_stack.wmx.differential.command import Command
from robot_stack.wmx.differential.kinematics import REST, BaseGeometry, WheelPair, body_twist, wheel_speeds

# A longer time since the last step restarts the shaping from the wheels' present speeds.
_LONGEST_STEP_S = 0.1


@dataclass(frozen=True, slots=True)
class WheelCommand:
    """speeds: rad/s, of wheels that drive forward. ramp_s: in which the engine reaches them; None: in the times of the
    interface documents.
    """

    speeds: WheelPair
    ramp_s: float | None = None


class TwistShaper:
    """Belongs to one thread. Times are the engine's own, in which the wheels move: after a pause it does not catch up.
    limits: None without limits.
    """

    def __init__(
        self, base: BaseGeometry, max_wheel_speed_radps: float, limits: MotionLimits | None, period_s: float
    ) -> None:
        self._base, self._most_radps = base, max_wheel_speed_radps
        self._limits, self._period_s = limits, period_s
        self._twist = self._acceleration = ZERO_TWIST
        self._step_at_s: float | None = None
        self._last = WheelCommand(REST)

    def shape(self, requested: Command, present: WheelPair, now_s: float) -> WheelCommand:
        """The next step. present: the speeds that the engine commands the wheels (rad/s). Silence is no command that
        has limits: it is a stop in the documented time.
        """
        wheels = wheel_speeds(requested.linear_mps, requested.angular_radps, self._base, self._most_radps)
        if self._limits is None:
            return WheelCommand(wheels)
        if requested.text:
            self._step_at_s = None
            return WheelCommand(REST)
        if now_s == self._step_at_s:
            return self._last
        dt_s = self._passed_s(present, now_s)
        target, still = _twist(wheels, self._base), ZERO_TWIST
        self._twist, self._acceleration = approach(self._twist, self._acceleration, target, still, self._limits, dt_s)
        speeds = wheel_speeds(self._twist.vx, self._twist.omega, self._base, self._most_radps)
        # If the period is longer than the step, the next one arrives before this one is complete.
        self._last = WheelCommand(speeds, dt_s + self._period_s)
        return self._last

    def _passed_s(self, present: WheelPair, now_s: float) -> float:
        """Time since the last step; without one it starts from the wheels' present speeds."""
        before_s, self._step_at_s = self._step_at_s, now_s
        if before_s is not None and 0.0 < now_s - before_s <= _LONGEST_STEP_S:
            return now_s - before_s
        self._twist, self._acceleration = _twist(present, self._base), ZERO_TWIST
        return self._period_s


def _twist(wheels: WheelPair, base: BaseGeometry) -> Twist2:
    linear_mps, angular_radps = body_twist(wheels, base)
    return Twist2(linear_mps, 0.0, angular_radps)

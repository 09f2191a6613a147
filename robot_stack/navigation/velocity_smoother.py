"""Smooths commands by acceleration and jerk limits."""

from __future__ import annotations

import math

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.core.limits import MotionLimits

# Largest lead of the command over the measured twist.
_LEAD_MPS, _LEAD_RADPS = 0.3, 0.3


class VelocitySmoother:
    """Jerk limits the build-up of acceleration; its reduction is immediate."""

    def __init__(self) -> None:
        self.twist = ZERO_TWIST
        self._acceleration = (0.0, 0.0, 0.0)

    def reset(self, twist: Twist2) -> None:
        self.twist, self._acceleration = twist, (0.0, 0.0, 0.0)

    def start(self, measured: Twist2) -> Twist2:
        """Start of the next step: the last command, bounded in its lead over the measured twist."""
        t = self.twist
        dx, dy = t.vx - measured.vx, t.vy - measured.vy
        lead = math.hypot(dx, dy)
        share = 1.0 if lead <= _LEAD_MPS else _LEAD_MPS / lead
        turn = max(-_LEAD_RADPS, min(_LEAD_RADPS, t.omega - measured.omega))
        return Twist2(measured.vx + share * dx, measured.vy + share * dy, measured.omega + turn)

    def towards(self, requested: Twist2, start: Twist2, limits: MotionLimits, dt_s: float) -> Twist2:
        """The next command on the way from ``start`` to ``requested``; a non-finite one counts as zero."""
        if dt_s <= 0.0:
            return self.twist
        requested = requested if requested.is_finite() else ZERO_TWIST
        ax, ay = (requested.vx - start.vx) / dt_s, (requested.vy - start.vy) / dt_s
        ax, ay = _within(ax, ay, limits.acceleration_mps2)
        ox, oy, ow = self._acceleration
        if math.hypot(ax, ay) > math.hypot(ox, oy) or ax * ox + ay * oy < 0.0:
            jx, jy = _within(ax - ox, ay - oy, limits.jerk_mps3 * dt_s)
            ax, ay = ox + jx, oy + jy
            if ax * (requested.vx - start.vx) + ay * (requested.vy - start.vy) < 0.0:
                ax, ay = 0.0, 0.0  # it would accelerate away from the command
        aw = max(
            -limits.yaw_acceleration_radps2, min(limits.yaw_acceleration_radps2, (requested.omega - start.omega) / dt_s)
        )
        change = limits.yaw_jerk_radps3 * dt_s
        if abs(aw) > abs(ow) or aw * ow < 0.0:
            aw = ow + max(-change, min(change, aw - ow))
            if aw * (requested.omega - start.omega) < 0.0:
                aw = 0.0
        self._acceleration = (ax, ay, aw)
        self.twist = Twist2(start.vx + ax * dt_s, start.vy + ay * dt_s, start.omega + aw * dt_s)
        return self.twist


def _within(x: float, y: float, most: float) -> tuple[float, float]:
    size = math.hypot(x, y)
    factor = 1.0 if size <= most else most / size
    return factor * x, factor * y

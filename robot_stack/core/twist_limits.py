"""Limits of the body's twist: speed, acceleration, jerk, braking.

All of them keep the direction of the twist: a twist above a limit is scaled as a whole, and a change of twist follows
the straight line to its target, so that vx, vy and omega arrive together and a slower robot still drives the same path.
"""

from __future__ import annotations

import math

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.core.limits import MotionLimits
from robot_stack.core.ramp import stoppable_rate

# Beyond this, squares of commands could overflow. No robot reaches such a value; only its direction is used.
_HUGE = 1e6
# A target whose rate exceeds this many full accelerations is a step and is not tracked.
_STEP = 1.25
_ROUNDING = 1e-12


def limit_speed(twist: Twist2, max_speed_mps: float, max_yaw_rate_radps: float) -> Twist2:
    """``twist`` scaled as a whole until its speed (the norm of vx, vy) and its yaw rate are within the limits.

    A limit of 0 stops everything: a turn without the translation that belongs to it would be another path.
    ``twist`` must be finite and may be huge.
    """
    size = max(abs(twist.vx), abs(twist.vy), abs(twist.omega))
    if size > _HUGE:
        twist = twist.scaled(1.0 / size).scaled(_HUGE)
    speed, yaw_rate = math.hypot(twist.vx, twist.vy), abs(twist.omega)
    factor = 1.0
    if speed > max_speed_mps:
        factor = max_speed_mps / speed
    if yaw_rate > max_yaw_rate_radps:
        factor = min(factor, max_yaw_rate_radps / yaw_rate)
    return twist if factor == 1.0 else twist.scaled(factor)


def approach(
    twist: Twist2, acceleration: Twist2, target: Twist2, target_rate: Twist2, limits: MotionLimits, dt_s: float
) -> tuple[Twist2, Twist2]:
    """One step of ``twist`` towards ``target`` within the acceleration and the jerk of ``limits``.

    ``acceleration`` is the one of the last step (m/s2, rad/s2). It grows and shrinks no faster than the jerk, early
    enough not to overshoot a target that stays. One exception, on the safe side: an acceleration that leads away from
    the target is dropped at once, because a robot that must slow down must not speed up first.

    ``target_rate`` is the rate of the target itself (m/s2, rad/s2, see ``followable_rate``). A target that keeps within
    the limits is followed without lag: the step ends where the target will be by then.

    Returns (twist, acceleration) after ``dt_s``.
    """
    ux, uy, uw = target_rate.vx, target_rate.vy, target_rate.omega
    # Everything relative to the moving target: d is the way to it, r the acceleration.
    dx, dy, dw = target.vx - twist.vx, target.vy - twist.vy, target.omega - twist.omega
    rx, ry, rw = acceleration.vx - ux, acceleration.vy - uy, acceleration.omega - uw
    wx = wy = ww = 0.0
    # Length of the way: the seconds that it takes at full acceleration.
    seconds = max(math.hypot(dx, dy) / limits.acceleration_mps2, abs(dw) / limits.yaw_acceleration_radps2)
    if seconds > 0.0:
        nx, ny, nw = dx / seconds, dy / seconds, dw / seconds  # full acceleration along the way
        rx, ry, rw = _without_adverse_part(rx, ry, rw, nx, ny, nw, limits)
        # Jerk along the way, in full accelerations per second.
        kappa = 1.0 / max(math.hypot(nx, ny) / limits.jerk_mps3, abs(nw) / limits.yaw_jerk_radps3)
        share = min(1.0, stoppable_rate(seconds, kappa, dt_s))
        wx, wy, ww = nx * share, ny * share, nw * share
    ax, ay, aw = _towards(rx + ux, ry + uy, rw + uw, wx + ux, wy + uy, ww + uw, limits, dt_s)
    new = Twist2(twist.vx + ax * dt_s, twist.vy + ay * dt_s, twist.omega + aw * dt_s)
    if target_rate == ZERO_TWIST:
        rest_x, rest_y, rest_w = target.vx - new.vx, target.vy - new.vy, target.omega - new.omega
        if max(abs(rest_x), abs(rest_y), abs(rest_w)) < _ROUNDING:
            return target, Twist2(ax, ay, aw)
        # Steps of uneven length may overshoot a constant target slightly.
        passed = rest_x * dx + rest_y * dy + rest_w * dw <= 0.0
        if (
            passed
            and math.hypot(rest_x, rest_y) <= dt_s * dt_s * limits.jerk_mps3
            and abs(rest_w) <= dt_s * dt_s * limits.yaw_jerk_radps3
        ):
            return target, ZERO_TWIST
    return new, Twist2(ax, ay, aw)


def no_faster(
    twist: Twist2, acceleration: Twist2, before: Twist2, limits: MotionLimits, dt_s: float
) -> tuple[Twist2, Twist2]:
    """A step of ``approach`` from ``before``, (twist, acceleration), without the part beyond the speed limit.

    If a target jumps while the robot speeds up, the remaining acceleration shrinks no faster than the jerk allows: here
    it ends at once, on the safe side.
    """
    speed_mps, most_mps = twist.speed(), max(limits.speed_mps, before.speed())
    if speed_mps <= most_mps:
        return twist, acceleration
    slower = twist.scaled(most_mps / speed_mps)
    change = Twist2(slower.vx - before.vx, slower.vy - before.vy, slower.omega - before.omega)
    return slower, change.scaled(1.0 / dt_s)


def followable_rate(rate: Twist2, limits: MotionLimits) -> Twist2:
    """The rate of a target that can be tracked; a rate far beyond the accelerations is a step and gives zero."""
    size = max(rate.speed() / limits.acceleration_mps2, abs(rate.omega) / limits.yaw_acceleration_radps2)
    if size > _STEP:
        return ZERO_TWIST
    return rate if size <= 1.0 else rate.scaled(1.0 / size)


def _towards(
    ax: float, ay: float, aw: float, wx: float, wy: float, ww: float, limits: MotionLimits, dt_s: float
) -> tuple[float, float, float]:
    """From the acceleration ``a`` towards the desired ``w``, within acceleration and jerk."""
    wx, wy, ww = _at_most_full(wx, wy, ww, limits)
    jx, jy, jw = wx - ax, wy - ay, ww - aw
    needed_s = max(math.hypot(jx, jy) / limits.jerk_mps3, abs(jw) / limits.yaw_jerk_radps3)
    if needed_s <= dt_s:
        return wx, wy, ww
    part = dt_s / needed_s
    # The remains of a dropped acceleration, or of higher limits, may be too much in one direction.
    return _at_most_full(ax + jx * part, ay + jy * part, aw + jw * part, limits)


def _at_most_full(x: float, y: float, w: float, limits: MotionLimits) -> tuple[float, float, float]:
    full = max(math.hypot(x, y) / limits.acceleration_mps2, abs(w) / limits.yaw_acceleration_radps2)
    return (x, y, w) if full <= 1.0 else (x / full, y / full, w / full)


def _without_adverse_part(
    ax: float, ay: float, aw: float, nx: float, ny: float, nw: float, limits: MotionLimits
) -> tuple[float, float, float]:
    """The acceleration without its part that leads away from the way ``n``."""
    weight = (limits.acceleration_mps2 / limits.yaw_acceleration_radps2) ** 2  # makes rad and m comparable
    along = ax * nx + ay * ny + weight * aw * nw
    if along >= 0.0:
        return ax, ay, aw
    part = along / (nx * nx + ny * ny + weight * nw * nw)
    return ax - part * nx, ay - part * ny, aw - part * nw


def brake(twist: Twist2, deceleration_mps2: float, yaw_deceleration_radps2: float, dt_s: float) -> Twist2:
    """One step towards standstill along the twist's own direction, as hard as both decelerations
    allow; no jerk limit.
    """
    seconds = max(twist.speed() / deceleration_mps2, abs(twist.omega) / yaw_deceleration_radps2)
    return ZERO_TWIST if seconds <= dt_s else twist.scaled(1.0 - dt_s / seconds)

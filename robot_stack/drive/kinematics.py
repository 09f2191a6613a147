"""Kinematics of four swerve modules.

A module is a wheel that a vertical axis steers without end. Modules are in the order FL FR RL RR; positions are those
of the steering axes in base_link (m). A module's set point is a signed wheel speed (m/s) along its heading and the
heading itself (rad, about +z of base_link, 0 straight ahead). Turning a heading by half a turn and reversing the wheel
changes nothing for the robot, so that no module ever has to turn much further than 90 degrees.

Plain floats and tuples: with four modules they are faster than arrays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_stack.core.geometry import Twist2
from robot_stack.core.ramp import stoppable_rate

TURN = 2.0 * math.pi
HALF_TURN = math.pi
QUARTER_TURN = 0.5 * math.pi

Four = tuple[float, float, float, float]
Positions = tuple[tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]]
ZEROS: Four = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class ModuleSetPoints:
    """speeds_mps: signed, along the heading. angles_rad: headings in [-pi, pi]."""

    speeds_mps: Four
    angles_rad: Four


def wrapped(angle_rad: float) -> float:
    """The same direction in [-pi, pi]."""
    return math.remainder(angle_rad, TURN)


def nearest_equivalent(angle_rad: float, reference_rad: float) -> float:
    """The angle of the same direction that lies nearest to ``reference_rad``, which may count any number of turns."""
    return reference_rad + math.remainder(angle_rad - reference_rad, TURN)


def wheel_velocities(positions: Positions, twist: Twist2) -> tuple[tuple[float, float], ...]:
    """Velocity (vx, vy) in m/s of each module's contact point when the body moves with ``twist``, in base_link."""
    return tuple((twist.vx - twist.omega * y, twist.vy + twist.omega * x) for x, y in positions)


def fastest_wheel_mps(positions: Positions, twist: Twist2) -> float:
    """Speed of the fastest module, m/s."""
    vx, vy, omega = twist.vx, twist.vy, twist.omega
    return max(math.hypot(vx - omega * y, vy + omega * x) for x, y in positions)


def desaturated(positions: Positions, twist: Twist2, max_wheel_speed_mps: float) -> Twist2:
    """``twist`` scaled as a whole, turning included, until no wheel exceeds its speed: slower on the same path."""
    fastest = fastest_wheel_mps(positions, twist)
    return twist if fastest <= max_wheel_speed_mps else twist.scaled(max_wheel_speed_mps / fastest)


def x_lock_angles(positions: Positions) -> Four:
    """Headings that point every wheel at the robot's centre, in [-pi/2, pi/2]: a push cannot roll the robot away."""
    a, b, c, d = (math.remainder(math.atan2(y, x), HALF_TURN) for x, y in positions)
    return a, b, c, d


def turn_to(
    direction_rad: float, angle_rad: float, wheel_direction: float, hysteresis_rad: float
) -> tuple[float, float]:
    """The turn after which the wheel of a module at heading ``angle_rad`` moves along ``direction_rad``.

    wheel_direction: +1 if the wheel has been rolling forward along its heading, -1 if backward. It is kept
    unless the turn would exceed 90 degrees by more than the hysteresis, so that a direction that hovers at 90
    degrees does not make it chatter.

    Returns (turn in rad, new sense); the magnitude of the turn is at most 90 degrees plus the hysteresis.
    """
    offset = 0.0 if wheel_direction > 0.0 else HALF_TURN
    turn = math.remainder(direction_rad - angle_rad - offset, TURN)
    if abs(turn) <= QUARTER_TURN + hysteresis_rad:
        return turn, wheel_direction
    return turn - math.copysign(HALF_TURN, turn), -wheel_direction


def steering_step(
    turn_rad: float, rate_radps: float, max_rate_radps: float, max_acceleration_radps2: float, dt_s: float
) -> tuple[float, float]:
    """One step of a steering axis that has to turn by ``turn_rad`` and now turns at ``rate_radps``.

    The axis turns as fast as its rate and acceleration allow and can always stop at the target, as long as the
    target does not move. Returns (angle turned in this step, new rate).
    """
    gain = max_acceleration_radps2 * dt_s
    rate = turn_rad / dt_s
    if abs(rate) <= min(gain, max_rate_radps) and abs(rate - rate_radps) <= gain:
        return turn_rad, rate  # there in this step, and able to stop in the next: the ordinary case, and the fast one
    wanted = min(max_rate_radps, stoppable_rate(abs(turn_rad), max_acceleration_radps2, dt_s))
    rate = min(max(math.copysign(wanted, turn_rad), rate_radps - gain), rate_radps + gain)
    return rate * dt_s, rate


def cosine_scale(error_rad: float) -> float:
    """The share of a wheel's speed to drive while its heading is off by ``error_rad``: 0 beyond 90
    degrees.
    """
    return max(0.0, math.cos(error_rad))

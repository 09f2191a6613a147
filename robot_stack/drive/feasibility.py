"""Feasibility of a step for the modules: steering rate and acceleration, wheel acceleration, slip.

A twist requires a heading and a speed of every module. A module whose heading lags drags its wheel sideways over
the ground: speed times the sine of the heading's error. A step of the twist is feasible if every module keeps that slip
within a tolerance and its wheel within its acceleration; otherwise a smaller part of the step is taken. Near
standstill, where directions change fastest, the tolerance lets the modules turn while the robot creeps; at standstill
nothing slips at all. The idea of limiting the step of the set point instead of each module alone is that of the FRC
teams' set point generators.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_stack.core.geometry import Twist2
from robot_stack.drive.kinematics import QUARTER_TURN, ZEROS, Four, Positions, steering_step, turn_to, wrapped

# Halvings of a step that is not feasible as a whole: it is then found to 1/32 of its length.
_HALVINGS = 5
# Slower than this a module has no direction of its own and keeps its heading.
_NO_SPEED_MPS = 1e-9


@dataclass(frozen=True, slots=True)
class ModuleLimits:
    """Limits of one module.

    max_wheel_speed_mps, max_wheel_acceleration_mps2: at the ground, along the heading.
    max_steering_rate_radps, max_steering_acceleration_radps2: of the heading's set point.
    slip_tolerance_mps: accepted sideways speed at the ground.
    reversal_hysteresis_rad: see ``kinematics.turn_to``.
    """

    max_wheel_speed_mps: float
    max_wheel_acceleration_mps2: float
    max_steering_rate_radps: float
    max_steering_acceleration_radps2: float
    slip_tolerance_mps: float
    reversal_hysteresis_rad: float


@dataclass(frozen=True, slots=True)
class ModuleStates:
    """Set points of the modules. angles_rad: headings in [-pi, pi]; rates_radps: of the headings; senses: +1 or -1, the
    way the wheel rolls along its heading; speeds_mps: signed, along the heading.
    """

    angles_rad: Four
    rates_radps: Four = ZEROS
    wheel_directions: Four = (1.0, 1.0, 1.0, 1.0)
    speeds_mps: Four = ZEROS


def follow(
    positions: Positions, limits: ModuleLimits, states: ModuleStates, twist: Twist2, dt_s: float
) -> tuple[ModuleStates, bool]:
    """One step of the modules after ``twist``. Returns (new states, feasible).

    If it is not feasible the returned states are incomplete: do not use them.
    """
    vx, vy, omega = twist.vx, twist.vy, twist.omega
    speed_change = limits.max_wheel_acceleration_mps2 * dt_s + 1e-12
    angles, rates = list(states.angles_rad), list(states.rates_radps)
    wheel_directions, speeds = list(states.wheel_directions), list(states.speeds_mps)
    for i, (x, y) in enumerate(positions):
        wx, wy = vx - omega * y, vy + omega * x
        speed = math.hypot(wx, wy)
        turn = 0.0
        if speed > _NO_SPEED_MPS:
            turn, wheel_directions[i] = turn_to(
                math.atan2(wy, wx), angles[i], wheel_directions[i], limits.reversal_hysteresis_rad
            )
        if turn == 0.0 and rates[i] == 0.0:
            step = 0.0
        else:
            step, rates[i] = steering_step(
                turn, rates[i], limits.max_steering_rate_radps, limits.max_steering_acceleration_radps2, dt_s
            )
            angles[i] = wrapped(angles[i] + step)
        error = turn - step
        if abs(error) < QUARTER_TURN:
            along, slip = speed * math.cos(error), speed * abs(math.sin(error))
        else:
            along, slip = 0.0, speed  # within the hysteresis beyond 90 degrees the wheel stands: all of it is slip
        new_speed = wheel_directions[i] * along
        if slip > limits.slip_tolerance_mps or abs(new_speed - speeds[i]) > speed_change:
            return states, False
        speeds[i] = new_speed
    return _states(angles, rates, wheel_directions, speeds), True


def follow_anyhow(
    positions: Positions, limits: ModuleLimits, states: ModuleStates, twist: Twist2, dt_s: float
) -> ModuleStates:
    """One step of the modules after ``twist`` as well as the steering can, for braking: always succeeds."""
    boundless = ModuleLimits(
        limits.max_wheel_speed_mps,
        math.inf,
        limits.max_steering_rate_radps,
        limits.max_steering_acceleration_radps2,
        math.inf,
        limits.reversal_hysteresis_rad,
    )
    return follow(positions, boundless, states, twist, dt_s)[0]


def turn_in_place(
    limits: ModuleLimits, states: ModuleStates, directions_rad: tuple[float | None, ...], dt_s: float
) -> tuple[ModuleStates, float]:
    """One step of the headings towards ``directions_rad`` (None: keep the heading) with the wheels at rest.

    Returns (new states, largest remaining error in rad).
    """
    angles, rates, wheel_directions = list(states.angles_rad), list(states.rates_radps), list(states.wheel_directions)
    largest = 0.0
    for i, direction in enumerate(directions_rad):
        turn = 0.0
        if direction is not None:
            turn, wheel_directions[i] = turn_to(
                direction, angles[i], wheel_directions[i], limits.reversal_hysteresis_rad
            )
        step, rates[i] = steering_step(
            turn, rates[i], limits.max_steering_rate_radps, limits.max_steering_acceleration_radps2, dt_s
        )
        angles[i] = wrapped(angles[i] + step)
        largest = max(largest, abs(turn - step))
    return _states(angles, rates, wheel_directions, [0.0, 0.0, 0.0, 0.0]), largest


def feasible_step(
    positions: Positions, limits: ModuleLimits, states: ModuleStates, start: Twist2, goal: Twist2, dt_s: float
) -> tuple[Twist2, ModuleStates] | None:
    """The largest part of the step from ``start`` to ``goal`` that all modules can do.

    Returns (twist, module states), or None if not even staying at ``start`` is possible: then brake.
    """
    followed, feasible = follow(positions, limits, states, goal, dt_s)
    if feasible:
        return goal, followed
    best, low, high = follow(positions, limits, states, start, dt_s), 0.0, 1.0
    twist = start
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        candidate = _between(start, goal, middle)
        followed, feasible = follow(positions, limits, states, candidate, dt_s)
        if feasible:
            best, twist, low = (followed, True), candidate, middle
        else:
            high = middle
    return (twist, best[0]) if best[1] else None


def _between(start: Twist2, goal: Twist2, part: float) -> Twist2:
    return Twist2(
        start.vx + part * (goal.vx - start.vx),
        start.vy + part * (goal.vy - start.vy),
        start.omega + part * (goal.omega - start.omega),
    )


def _states(
    angles: list[float], rates: list[float], wheel_directions: list[float], speeds: list[float]
) -> ModuleStates:
    return ModuleStates(
        (angles[0], angles[1], angles[2], angles[3]),
        (rates[0], rates[1], rates[2], rates[3]),
        (wheel_directions[0], wheel_directions[1], wheel_directions[2], wheel_directions[3]),
        (speeds[0], speeds[1], speeds[2], speeds[3]),
    )

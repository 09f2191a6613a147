"""The drive's set point: the twist to command now, and the module set points for it.

Every step goes from the last set point towards the requested one: speed limits, jerk and acceleration, feasibility,
desaturation. The set point is the only state; sensors give only the module headings, never the speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.core.limits import MotionLimits
from robot_stack.core.robot import Robot
from robot_stack.core.twist_limits import approach, brake, followable_rate, limit_speed, no_faster
from robot_stack.drive.arbitration import Command
from robot_stack.drive.feasibility import ModuleStates, feasible_step, follow_anyhow, turn_in_place
from robot_stack.drive.kinematics import (
    ZEROS,
    Four,
    ModuleSetPoints,
    cosine_scale,
    desaturated,
    wheel_velocities,
    wrapped,
    x_lock_angles,
)
from robot_stack.drive.params import SwerveControllerParams, module_limits, module_positions


class DriveState(Enum):
    """State of the drive."""

    DRIVING = "driving"
    ALIGNING = "aligning the modules"
    HOLDING = "holding"
    LOCKED = "wheels crossed"
    BRAKING = "braking"
    HALTED = "halted"


@dataclass(frozen=True, slots=True)
class DriveOutput:
    """twist: the set point of the body, base_link. modules: their set points. stuck: modules whose heading keeps the
    robot from starting.
    """

    twist: Twist2
    modules: ModuleSetPoints
    state: DriveState
    stuck: tuple[int, ...] = ()


class SwerveDrive:
    """The set point and its steps."""

    def __init__(self, params: SwerveControllerParams, robot: Robot) -> None:
        self._positions = module_positions(robot)
        self._limits = module_limits(params.module, robot)
        self._params = params.drive
        self._brake_mps2 = robot.emergency_deceleration_mps2
        self._x_lock = x_lock_angles(self._positions)
        self._states = ModuleStates(ZEROS)
        self._twist = ZERO_TWIST
        self._acceleration = ZERO_TWIST
        self._rest_s = 0.0
        self._aligning_s = 0.0
        self._state = DriveState.HALTED

    @property
    def twist(self) -> Twist2:
        """The present set point of the body."""
        return self._twist

    @property
    def may_brake(self) -> bool:
        """True if the set point moves and is not being braked yet."""
        return self._twist != ZERO_TWIST and self._state is not DriveState.BRAKING

    def halt(self, measured_rad: Four | None) -> DriveOutput:
        """Commands zero at once. The headings stay: at ``measured_rad`` (rad, any number of turns) if it is
        known.
        """
        angles = self._states.angles_rad if measured_rad is None else _wrapped_all(measured_rad)
        self._states = ModuleStates(angles, wheel_directions=self._states.wheel_directions)
        self._twist = self._acceleration = ZERO_TWIST
        self._rest_s = 0.0
        self._state = DriveState.HALTED
        return self._output(None)

    def step(
        self,
        requested: Command,
        limits: MotionLimits,
        dt_s: float,
        measured_rad: Four | None,
        *,
        standing: bool,
        braking: bool = False,
    ) -> DriveOutput:
        """One step of ``dt_s`` towards ``requested`` (one that is not finite counts as standstill).

        measured_rad: measured headings, any number of turns; None if unknown. standing: no wheel turns, as measured.
        braking: towards standstill at the emergency deceleration, whatever is requested.
        A step without time (0, negative, NaN) changes nothing.
        """
        if not dt_s > 0.0:
            return self._output(measured_rad)
        dt_s = min(dt_s, self._params.longest_step_s)
        self._aligning_s = self._aligning_s + dt_s if self._state is DriveState.ALIGNING else 0.0
        target, rate = self._target(requested, limits)
        if braking:
            self._brake(dt_s)
        elif self._twist != ZERO_TWIST:
            self._drive(target, rate, limits, dt_s)
        elif target != ZERO_TWIST:
            self._start(target, rate, limits, dt_s, measured_rad)
        else:
            self._rest(dt_s, standing)
        return self._output(measured_rad)

    def _target(self, requested: Command, limits: MotionLimits) -> tuple[Twist2, Twist2]:
        """(target now, its rate). A growing command is extrapolated to now, since commands are
        samples."""
        if not requested.twist.is_finite():
            return ZERO_TWIST, ZERO_TWIST
        limited = limit_speed(requested.twist, limits.speed_mps, limits.yaw_rate_radps)
        s = self._params
        if limited.speed() < s.rest_speed_mps and abs(limited.omega) < s.rest_yaw_rate_radps:
            return ZERO_TWIST, ZERO_TWIST
        rate = followable_rate(requested.rate, limits)
        if limited is not requested.twist or rate == ZERO_TWIST:
            return limited, ZERO_TWIST
        age_s = min(requested.age_s, s.longest_step_s)
        ahead = Twist2(limited.vx + rate.vx * age_s, limited.vy + rate.vy * age_s, limited.omega + rate.omega * age_s)
        return limit_speed(ahead, limits.speed_mps, limits.yaw_rate_radps), rate

    def _drive(self, target: Twist2, rate: Twist2, limits: MotionLimits, dt_s: float) -> None:
        start = self._twist
        goal, acceleration = approach(start, self._acceleration, target, rate, limits, dt_s)
        goal, acceleration = no_faster(goal, acceleration, start, limits, dt_s)
        result = feasible_step(self._positions, self._limits, self._states, start, goal, dt_s)
        if result is None:
            self._brake(dt_s)
            return
        twist, states = result
        slower = desaturated(self._positions, twist, self._limits.max_wheel_speed_mps)
        if slower is not twist:
            states = follow_anyhow(self._positions, self._limits, self._states, slower, dt_s)
        if slower is not goal:
            acceleration = Twist2(
                (slower.vx - start.vx) / dt_s, (slower.vy - start.vy) / dt_s, (slower.omega - start.omega) / dt_s
            )
        self._twist, self._acceleration, self._states = slower, acceleration, states
        self._rest_s = 0.0
        self._state = DriveState.DRIVING

    def _start(
        self, target: Twist2, rate: Twist2, limits: MotionLimits, dt_s: float, measured_rad: Four | None
    ) -> None:
        """Starts from standstill: first the headings, then the wheels."""
        self._rest_s = 0.0
        directions = tuple(
            math.atan2(vy, vx) if vx or vy else None for vx, vy in wheel_velocities(self._positions, target)
        )
        states, error = turn_in_place(self._limits, self._states, directions, dt_s)
        lag = 0.0 if measured_rad is None else max(_lags(states.angles_rad, measured_rad))
        if error + lag <= self._params.align_tolerance_rad:
            self._drive(target, rate, limits, dt_s)
            return
        self._states, self._acceleration, self._state = states, ZERO_TWIST, DriveState.ALIGNING

    def _brake(self, dt_s: float) -> None:
        self._twist = brake(self._twist, self._brake_mps2, self._params.emergency_yaw_deceleration_radps2, dt_s)
        self._states = follow_anyhow(self._positions, self._limits, self._states, self._twist, dt_s)
        self._acceleration, self._rest_s, self._state = ZERO_TWIST, 0.0, DriveState.BRAKING

    def _rest(self, dt_s: float, standing: bool) -> None:
        self._acceleration = ZERO_TWIST
        self._rest_s = self._rest_s + dt_s if standing else 0.0
        lock = self._rest_s >= self._params.x_lock_after_s
        directions = self._x_lock if lock else (None, None, None, None)
        self._states, _ = turn_in_place(self._limits, self._states, directions, dt_s)
        self._state = DriveState.LOCKED if lock else DriveState.HOLDING

    def _output(self, measured_rad: Four | None) -> DriveOutput:
        """Scales the speed of wheels whose heading lags behind its set point by the cosine of the lag."""
        angles, speeds = self._states.angles_rad, self._states.speeds_mps
        stuck: tuple[int, ...] = ()
        if measured_rad is not None and speeds != ZEROS:
            scaled = [
                speed * cosine_scale(angle - measured)
                for speed, angle, measured in zip(speeds, angles, measured_rad, strict=True)
            ]
            speeds = scaled[0], scaled[1], scaled[2], scaled[3]
        if measured_rad is not None and self._aligning_s > self._params.align_timeout_s:
            tolerance = self._params.align_tolerance_rad
            stuck = tuple(i for i, lag in enumerate(_lags(angles, measured_rad)) if lag > tolerance)
        return DriveOutput(self._twist, ModuleSetPoints(speeds, angles), self._state, stuck)


def _wrapped_all(angles_rad: Four) -> Four:
    a, b, c, d = angles_rad
    return wrapped(a), wrapped(b), wrapped(c), wrapped(d)


def _lags(angles_rad: Four, measured_rad: Four) -> list[float]:
    return [abs(wrapped(angle - measured)) for angle, measured in zip(angles_rad, measured_rad, strict=True)]

"""Motion commands of the simulated engine: checks first, all axes, then all axes start. Nothing moves on an error."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.api.enums import AxisCommandMode, DetailOperationState, OperationState, ProfileType
from robot_stack.wmx.api.errors import CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.api.values import (
    Motion_PosCommand,
    Profile,
    Velocity_TimedVelCommand,
    Velocity_VelCommand,
)
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.engine_server import checks, rows
from robot_stack.wmx.engine_server.kernel import begin_stop, estop_axes, stop_rate
from robot_stack.wmx.engine_server.profile import plan_position, plan_velocity
from robot_stack.wmx.engine_server.splines import Splines
from robot_stack.wmx.engine_server.state import Condition, EngineArrays

_NO_ERROR = int(ErrorCode.PyNone)
_POSITION_STATES = (OperationState.Idle, OperationState.Pos)
_VELOCITY_STATES = (OperationState.Idle, OperationState.Velocity)
_WRONG_MODE = {
    AxisCommandMode.Position: int(CoreMotionErrorCode.NotPosMode),
    AxisCommandMode.Velocity: int(CoreMotionErrorCode.NotVelocityMode),
}


class MotionControl:
    """Starts and ends motions. ``device`` is the caller, which owns the axes that it commanded last.

    Numbers are converted to floats before compiled code: an integer would trigger a compilation during a ride.
    """

    def __init__(self, arrays: EngineArrays, condition: Condition) -> None:
        self._a = arrays
        self._condition = condition
        self.splines = Splines(arrays, condition.cycle_time_s, self._spline_startable)

    def warm_up(self) -> None:
        """Runs every compiled function once, on axis 0, whose state is worthless afterwards."""
        profile = Profile.SetupTrapezoidal(1.0, 1.0, 1.0)
        self._begin_position(0, 0.0, profile, 0)
        self._begin_velocity(0, profile, 0, 0.0)
        self.stop_axis(0, self._own_rate(0), DetailOperationState.Stop)
        self.emergency_stop(servo_off=False)
        self.splines.warm_up()

    def start_position(self, device: int, commands: Sequence[Motion_PosCommand], *, relative: bool) -> int:
        """StartPos, or StartMov with ``relative``."""
        axes = [command.axis for command in commands]
        code = self._reachable(axes)
        if code:
            return code
        targets = [self._target(command, relative) for command in commands]
        for command, target in zip(commands, targets, strict=True):
            code = checks.position_profile(command.profile) or self._target_code(command.axis, target)
            if code:
                return code
        code = self._startable(
            axes, AxisCommandMode.Position, _POSITION_STATES, CoreMotionErrorCode.NotIdleOrPosState
        ) or self._towards_limit([(a, t - self._a.reals[Real.POS_CMD, a]) for a, t in zip(axes, targets, strict=True)])
        if code:
            return code
        for command, target in zip(commands, targets, strict=True):
            self._begin_position(command.axis, target, command.profile, device)
        return _NO_ERROR

    def start_velocity(self, device: int, commands: Sequence[Velocity_VelCommand | Velocity_TimedVelCommand]) -> int:
        """StartVel, plain or timed."""
        axes = [command.axis for command in commands]
        code = self._reachable(axes)
        for command in commands:
            code = code or checks.velocity_profile(command.profile) or _timed_code(command)
        code = (
            code
            or self._startable(
                axes, AxisCommandMode.Velocity, _VELOCITY_STATES, CoreMotionErrorCode.NotIdleOrVelocityState
            )
            or self._towards_limit([(command.axis, command.profile.velocity) for command in commands])
        )
        if code:
            return code
        for command in commands:
            self._begin_velocity(command.axis, command.profile, device, _run_time_s(command))
        return _NO_ERROR

    def start_spline(
        self, device: int, channel: int, axes: Sequence[int], points: NDArray[np.float64], times_ms: NDArray[np.float64]
    ) -> int:
        """StartCSplinePos with point times: ``points`` (n, dimensions) user units, ``times_ms`` (n,)."""
        if not self._condition.communicating:
            return ErrorCode.CommNotStarted
        return self.splines.start(device, channel, axes, points, times_ms)

    def stop(self, axes: Sequence[int], mode: AxisCommandMode) -> int:
        """Stop: by the running command's own profile."""

        def stop(axis: int) -> None:
            if self._state(axis) != OperationState.Stop:
                self.stop_axis(axis, self._own_rate(axis), DetailOperationState.Stop)

        return self._stop_each(axes, mode, stop)

    def quick_stop(self, axes: Sequence[int], mode: AxisCommandMode) -> int:
        """ExecQuickStop."""
        return self._stop_each(axes, mode, self.quick_stop_axis)

    def quick_stop_axis(self, axis: int) -> None:
        """Ends the motion of one axis at its quick-stop deceleration, in any mode; no effect on an idle one."""
        if self._a.flags[Flag.DETAIL_OP_STATE, axis] != DetailOperationState.Stop_QStop:
            dec = float(self._a.params[rows.QUICK_STOP_DEC, axis])
            self.stop_axis(axis, dec, DetailOperationState.Stop_QStop)

    def emergency_stop(self, servo_off: bool) -> None:
        """Stops all axes in any state; with ``servo_off`` the servos go off once at rest."""
        a = self._a
        estop_axes(a.reals, a.flags, a.params, a.work, a.plan, servo_off)

    def _speed(self, axis: int) -> float:
        return abs(float(self._a.reals[Real.VELOCITY_CMD, axis]))

    def _own_rate(self, axis: int) -> float:
        """Deceleration of the running command's own profile."""
        return stop_rate(self._a.params, axis, self._speed(axis))

    def _state(self, axis: int) -> int:
        return int(self._a.flags[Flag.OP_STATE, axis])

    def _target(self, command: Motion_PosCommand, relative: bool) -> float:
        if not relative:
            return command.target
        row = Real.PROFILE_TARGET_POS if self._state(command.axis) == OperationState.Pos else Real.POS_CMD
        return float(self._a.reals[row, command.axis]) + command.target

    def _target_code(self, axis: int, target: float) -> int:
        return checks.target(target, self._a.params[rows.COUNTS_PER_UNIT, axis], self._a.reals[Real.HOME_OFFSET, axis])

    def _reachable(self, axes: Sequence[int]) -> int:
        if not self._condition.communicating:
            return ErrorCode.CommNotStarted
        return checks.axes_in_range(axes, self._a.n_axes)

    def _startable(self, axes: Sequence[int], mode: AxisCommandMode, states: Sequence[int], wrong_state: int) -> int:
        if self._condition.emergency_stop:
            return CoreMotionErrorCode.EmergencyStopSignalOn
        flags = self._a.flags
        for axis in axes:
            if flags[Flag.AMP_ALARM, axis] or flags[Flag.FOLLOWING_ERROR_ALARM, axis]:
                return ErrorCode.AxisAmpAlarm
            if not flags[Flag.SERVO_ON, axis]:
                return CoreMotionErrorCode.NotServoOn
            if flags[Flag.COMMAND_MODE, axis] != mode:
                return _WRONG_MODE[mode]
            if flags[Flag.OP_STATE, axis] not in states:
                return wrong_state
        return _NO_ERROR

    def _towards_limit(self, moves: Sequence[tuple[int, float]]) -> int:
        codes = (checks.towards_limit(self._a.flags, axis, direction) for axis, direction in moves)
        return next(filter(None, codes), _NO_ERROR)

    def _stop_each(self, axes: Sequence[int], mode: AxisCommandMode, stop: Callable[[int], None]) -> int:
        """Stops the axes that are in the mode, and returns an error if any is not (ExecQuickStop of several axes)."""
        code = self._reachable(axes)
        if code:
            return code
        fitting = [axis for axis in axes if self._a.flags[Flag.COMMAND_MODE, axis] == mode]
        for axis in fitting:
            stop(axis)
        return _NO_ERROR if len(fitting) == len(axes) else _WRONG_MODE[mode]

    def _spline_startable(self, moves: Sequence[tuple[int, float]]) -> int:
        axes, states = [axis for axis, _ in moves], (OperationState.Idle,)
        code = self._startable(axes, AxisCommandMode.Position, states, CoreMotionErrorCode.NotIdleOrIntplState)
        return code or self._towards_limit(moves)

    def _may_stop(self, axis: int, detail: DetailOperationState) -> bool:
        """A stop never replaces a more urgent one: stop, quick stop, emergency stop."""
        state = self._state(axis)
        more_urgent = state == OperationState.Stop and self._a.flags[Flag.DETAIL_OP_STATE, axis] > detail
        return state != OperationState.Idle and not more_urgent

    def stop_axis(self, axis: int, dec: float, detail: DetailOperationState) -> None:
        """Ends the motion of one axis at a deceleration; no effect on an idle one and on a more urgent stop."""
        a = self._a
        if not self._may_stop(axis, detail):
            return
        if self.splines.carries(axis):
            self.splines.stop(axis, float(dec), detail)
            return
        begin_stop(a.reals, a.flags, a.work, a.plan, axis, float(dec), int(detail), _NO_ERROR)

    def _begin_position(self, axis: int, target: float, profile: Profile, device: int) -> None:
        a = self._a
        acc, dec = float(profile.acc), float(profile.dec)
        if profile.type == ProfileType.TimeAccTrapezoidal:
            acc = profile.velocity / (1e-3 * profile.accTimeMilliseconds)
            dec = profile.velocity / (1e-3 * profile.decTimeMilliseconds)
        a.work[rows.SEGMENTS, axis] = plan_position(
            a.plan[axis],
            float(a.reals[Real.POS_CMD, axis]),
            float(a.reals[Real.VELOCITY_CMD, axis]),
            float(target),
            float(profile.velocity),
            acc,
            dec,
            int(a.work[rows.OVERTRAVEL, axis]),
        )
        a.reals[Real.PROFILE_TARGET_POS, axis] = target
        self._begun(axis, profile, device, OperationState.Pos, DetailOperationState.Pos, 0)

    def _begin_velocity(self, axis: int, profile: Profile, device: int, run_s: float) -> None:
        """run_s: 0 for ever, else the time at the velocity, which begins when that is reached."""
        a = self._a
        velocity = float(a.reals[Real.VELOCITY_CMD, axis])
        acc, dec = float(profile.acc), float(profile.dec)
        if profile.type == ProfileType.TimeAccTrapezoidal:
            acc, dec = _timed_rates(velocity, profile)
        position, wanted = float(a.reals[Real.POS_CMD, axis]), float(profile.velocity)
        segments = plan_velocity(a.plan[axis], position, velocity, wanted, acc, dec)
        a.work[rows.SEGMENTS, axis] = segments
        reached_s = float(a.plan[axis, segments - 2, 0]) if segments > 1 else 0.0
        run_cycles = max(1, math.ceil((reached_s + run_s) / self._condition.cycle_time_s - 1e-9)) if run_s else 0
        self._begun(axis, profile, device, OperationState.Velocity, DetailOperationState.Velocity, run_cycles)
        a.params[rows.PROFILE_DEC, axis], a.params[rows.PROFILE_DEC_TIME, axis] = dec, 0.0

    def _begun(
        self,
        axis: int,
        profile: Profile,
        device: int,
        state: OperationState,
        detail: DetailOperationState,
        run_cycles: int,
    ) -> None:
        a = self._a
        a.params[rows.PROFILE_DEC, axis] = profile.dec
        timed = profile.type == ProfileType.TimeAccTrapezoidal
        a.params[rows.PROFILE_DEC_TIME, axis] = 1e-3 * profile.decTimeMilliseconds if timed else 0.0
        a.work[rows.TICK, axis] = 0
        a.work[rows.RUN_CYCLES, axis] = run_cycles
        a.work[rows.SERVO_OFF_AT_REST, axis] = 0
        a.flags[Flag.OP_STATE, axis] = state
        a.flags[Flag.DETAIL_OP_STATE, axis] = detail
        a.flags[Flag.MOTION_COMPLETE, axis] = 0
        a.flags[Flag.CMD_DISTRIBUTION_END, axis] = 0
        a.flags[Flag.IN_POS, axis] = 0
        a.flags[Flag.POS_SET, axis] = 0
        a.flags[Flag.END_REASON, axis] = 0
        a.flags[Flag.OWNER, axis] = device


def _timed_code(command: object) -> int:
    if isinstance(command, Velocity_TimedVelCommand):
        return checks.timed_profile(command.profile) or checks.run_time(command.runTimeMilliseconds)
    return _NO_ERROR


def _run_time_s(command: object) -> float:
    return 1e-3 * command.runTimeMilliseconds if isinstance(command, Velocity_TimedVelCommand) else 0.0


def _timed_rates(velocity: float, profile: Profile) -> tuple[float, float]:
    """Rates of a profile by times: its velocity is reached in the first, and left for rest in the second. One rate of
    deceleration holds for the whole command, whether it slows down to its velocity or stops. 0 is a step.
    """
    acc_s, dec_s = 1e-3 * profile.accTimeMilliseconds, 1e-3 * profile.decTimeMilliseconds
    grows = abs(profile.velocity) if velocity * profile.velocity < 0.0 else abs(profile.velocity - velocity)
    falls = abs(profile.velocity or velocity)
    return (grows / acc_s if acc_s > 0.0 else 0.0), (falls / dec_s if dec_s > 0.0 else 0.0)

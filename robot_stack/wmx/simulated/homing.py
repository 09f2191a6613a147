"""Homing of the simulated engine: to the present position at once, or by a motion that searches for a sensor.

One moving type is implemented, to the home switch (HS); its searches are in ``homing_types``. A limit switch in
the homing direction reverses it once; otherwise, and always against the homing direction, the axis stops with
the error LSTriggered, whatever the limit's own action. Servo off, an alarm, a stop by any client and Cancel
end it too. Where the vendor's documents are silent: searches are fast, and a failed homing leaves the axis not homed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from robot_stack.wmx.api.enums import (
    AxisCommandMode,
    Config_HomeDirection,
    Config_HomeType,
    HomeError,
    HomeState,
    OperationState,
)
from robot_stack.wmx.api.errors import CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.bus import DriveFeedback
from robot_stack.wmx.simulated import rows
from robot_stack.wmx.simulated.homing_motion import HomingMotion, Run, rename
from robot_stack.wmx.simulated.homing_types import BACK_FROM_LIMIT, CLEAR_HOME_AT_START, HOME, Limited
from robot_stack.wmx.simulated.parameters import Parameters
from robot_stack.wmx.simulated.state import EngineArrays

_NO_ERROR = int(ErrorCode.PyNone)
_HARD_LIMIT = int(ErrorCode.AxisHardLimit)
_TOO_FAR: Final = {
    Limited.HOME_ON_AT_START: HomeError.MaxHSOnAtStartRevDistanceTraveled,
    Limited.AFTER_LIMIT: HomeError.MaxLSRevDistanceTraveled,
}


class Homing:
    """Starts, advances and ends homings. ``device`` is the caller, which owns the axis while it moves."""

    def __init__(self, arrays: EngineArrays, parameters: Parameters, feedback: DriveFeedback) -> None:
        self._a = arrays
        self._parameters = parameters
        self._feedback = feedback
        self._motion = HomingMotion(arrays)
        self._runs: dict[int, Run] = {}

    def start(self, device: int, axes: Sequence[int]) -> int:
        """StartHome: all axes or none. The axes exist, the bus runs, and there is no emergency stop."""
        for axis in axes:
            code = self._supported(axis) or self._startable(axis)
            if code:
                return code
        for axis in axes:
            self._a.flags[Flag.HOME_DONE, axis] = 0
            self._a.flags[Flag.HOME_ERROR, axis] = HomeError.NoError
            if self._parameters.home(axis).homeType == Config_HomeType.CurrentPos:
                self._arrive(axis, self._parameters.home(axis).homePosition)
            else:
                self._begin(device, axis)
        return _NO_ERROR

    def cancel(self, axis: int) -> int:
        """Cancel: stops a homing motion at its slow deceleration; no error where there is none."""
        run = self._runs.get(axis)
        if run is not None:
            self._a.flags[Flag.HOME_STATE, axis] = HomeState.Cancel
            self._motion.stop(axis, run.param.homingVelocitySlowDec)
        return _NO_ERROR

    def forget(self) -> None:
        """Drops all homings: the motion of all axes has been cancelled."""
        for axis in list(self._runs):
            self._end(axis)

    def step(self) -> None:
        """One cycle of every homing, after the feedback."""
        for axis, run in list(self._runs.items()):
            self._step(axis, run)

    # -- start ---------------------------------------------------------------------------------------------------------

    def _supported(self, axis: int) -> int:
        kind = Config_HomeType(self._parameters.home(axis).homeType)
        if kind is Config_HomeType.CurrentPos:
            return _NO_ERROR
        if "TouchProbe" in kind.name:
            return CoreMotionErrorCode.TouchProbeDetectionUnsupported
        if "LS" in kind.name or "MechanicalEnd" in kind.name:
            return CoreMotionErrorCode.LimitSwitchDetectionUnsupported
        if kind.name.startswith("HS") and not self._feedback.has_home_switch[axis]:
            return CoreMotionErrorCode.HomeSwitchDetectionUnsupported
        if "ZPulse" in kind.name:
            return CoreMotionErrorCode.ZPulseDetectionUnsupported
        return _NO_ERROR if kind is Config_HomeType.HS else ErrorCode.NoSupportedFunction

    def _startable(self, axis: int) -> int:
        flags = self._a.flags
        moves = self._parameters.home(axis).homeType != Config_HomeType.CurrentPos
        if moves and (flags[Flag.AMP_ALARM, axis] or flags[Flag.FOLLOWING_ERROR_ALARM, axis]):
            return ErrorCode.AxisAmpAlarm
        if not flags[Flag.SERVO_ON, axis]:
            return CoreMotionErrorCode.NotServoOn
        if moves and flags[Flag.COMMAND_MODE, axis] != AxisCommandMode.Position:
            return CoreMotionErrorCode.NotPosMode
        return _NO_ERROR if flags[Flag.OP_STATE, axis] == OperationState.Idle else ErrorCode.NotIdleState

    def _begin(self, device: int, axis: int) -> None:
        param = self._parameters.home(axis)
        direction = 1.0 if param.homeDirection == Config_HomeDirection.Positive else -1.0
        on_at_start = bool(self._a.flags[Flag.HOME_SWITCH, axis])
        run = self._runs[axis] = Run(param, [CLEAR_HOME_AT_START, HOME] if on_at_start else [HOME], direction)
        self._motion.claim(axis, device, param.homingVelocitySlowDec)
        self._search(axis, run)

    # -- cycle ---------------------------------------------------------------------------------------------------------

    def _step(self, axis: int, run: Run) -> None:
        flags = self._a.flags
        state = flags[Flag.OP_STATE, axis]
        if self._motion.stopped(axis):  # by Cancel or any client: over once at rest
            flags[Flag.HOME_STATE, axis] = HomeState.Cancel
        if state == OperationState.Stop:
            return
        at_rest = state == OperationState.Idle
        if flags[Flag.HOME_STATE, axis] == HomeState.Cancel or (at_rest and self._let_go(axis)):
            self._end(axis)
        elif not run.ahead:
            self._shift(axis, run, at_rest)
        elif at_rest:
            self._after_stop(axis, run)
        elif run.beyond:
            if self._limit_on(axis, run.way):
                self._fail(axis, run, HomeError.LSTriggered, _HARD_LIMIT)
        elif not run.stopping:
            self._watch(axis, run)

    def _let_go(self, axis: int) -> bool:
        """True if the drive no longer follows: an alarm, or its servo is off."""
        flags = self._a.flags
        return bool(flags[Flag.END_REASON, axis] or not flags[Flag.SERVO_ON, axis])

    def _search(self, axis: int, run: Run) -> None:
        speed, acc, dec = run.speeds
        run.begun_at = float(self._a.reals[Real.POS_CMD, axis])
        run.was_on = bool(self._a.flags[Flag.HOME_SWITCH, axis])
        self._a.flags[Flag.HOME_STATE, axis] = run.ahead[0].state
        self._motion.run(axis, run.way * speed, acc, dec)

    def _watch(self, axis: int, run: Run) -> None:
        search, on = run.ahead[0], bool(self._a.flags[Flag.HOME_SWITCH, axis])
        hit = on and not run.was_on if search.rising else run.was_on and not on
        run.was_on = on
        if hit:
            run.found = float(self._a.reals[Real.ACTUAL_POS, axis])
            self._pause(axis, run)
        elif self._limit_on(axis, run.way):
            self._run_into_limit(axis, run)
        elif run.too_far(float(self._a.reals[Real.POS_CMD, axis])):
            self._fail(axis, run, _TOO_FAR[search.limited], _NO_ERROR)

    def _limit_on(self, axis: int, direction: float) -> bool:
        """The limit switch at that end of travel."""
        named_positive = (direction > 0.0) == (self._a.work[rows.LS_REVERSED, axis] == 0)
        present = self._feedback.has_limit_switches[axis]
        return bool(present and self._a.flags[Flag.POSITIVE_LS if named_positive else Flag.NEGATIVE_LS, axis])

    def _pause(self, axis: int, run: Run) -> None:
        run.stopping = True
        self._motion.pause(axis, run.speeds[2])

    def _after_stop(self, axis: int, run: Run) -> None:
        here = float(self._a.reals[Real.POS_CMD, axis])
        run.reached = max(run.reached, run.direction * here)
        if run.ahead[0].beyond and not run.beyond and run.param.homingReverseDistance > 0.0:
            run.beyond = True
            self._motion.go(axis, here + run.way * run.param.homingReverseDistance, *run.speeds)
            return
        run.stopping = run.beyond = False
        run.ahead.pop(0)
        if run.ahead:
            self._search(axis, run)
        else:
            self._begin_shift(axis, run)

    def _run_into_limit(self, axis: int, run: Run) -> None:
        search = run.ahead[0]
        if search.reverse or run.turned:
            self._fail(axis, run, HomeError.LSTriggered, _HARD_LIMIT)
            return
        run.turned = True
        # Once the axis stands, the failed search runs first.
        run.ahead = [search, BACK_FROM_LIMIT, HOME]
        self._pause(axis, run)

    def _fail(self, axis: int, run: Run, error: HomeError, reason: int) -> None:
        dec = run.speeds[2] if run.ahead else run.param.homeShiftDec
        self._a.flags[Flag.HOME_ERROR, axis] = error
        self._a.flags[Flag.HOME_STATE, axis] = HomeState.Cancel
        self._motion.stop(axis, dec)
        self._a.flags[Flag.END_REASON, axis] = reason

    # -- from the found place to home ----------------------------------------------------------------------------------

    def _begin_shift(self, axis: int, run: Run) -> None:
        param = run.param
        run.found += run.direction * param.homeShiftDistance
        self._a.flags[Flag.HOME_STATE, axis] = HomeState.HomeShift
        self._motion.go(axis, run.found, param.homeShiftVelocity, param.homeShiftAcc, param.homeShiftDec)

    def _shift(self, axis: int, run: Run, at_rest: bool) -> None:
        if at_rest:
            self._a.flags[Flag.MOTION_COMPLETE, axis] = 1
            self._end(axis)
            self._arrive(axis, run.param.homePosition)
            return
        velocity = float(self._a.reals[Real.VELOCITY_CMD, axis])
        known = run.direction * velocity > 0.0 and run.direction * run.found <= run.reached
        if velocity and not known and self._limit_on(axis, velocity):
            self._fail(axis, run, HomeError.LSTriggered, _HARD_LIMIT)

    def _arrive(self, axis: int, position: float) -> None:
        rename(self._a, axis, Real.POS_CMD, position)
        self._a.flags[Flag.HOME_DONE, axis] = 1

    def _end(self, axis: int) -> None:
        del self._runs[axis]
        self._a.flags[Flag.HOME_STATE, axis] = HomeState.Idle
        self._motion.release(axis)

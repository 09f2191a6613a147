"""Homing of the simulated engine: to the present position at once, or by a motion that looks for a sensor.

The steps of a home type are in ``homing_types``. A limit switch that is not looked for ends a homing: in the homing
direction it makes the types with a home switch turn round once, otherwise, and always against the homing direction, the
axis stops with the error LSTriggered, whatever the limit's own action. A servo that goes off, an alarm, a stop by
anybody and Cancel end it too. Where the vendor is silent: the first search is fast, a z pulse and a second search are
slow, and a homing that failed leaves the axis not homed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from robot_stack.wmx.api.enums import (
    AxisCommandMode,
    Config_HomeDirection,
    Config_HomeType,
    DetailOperationState,
    HomeError,
    HomeState,
    OperationState,
)
from robot_stack.wmx.api.errors import CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.api.parameters import Config_HomeParam
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.bus import DriveFeedback
from robot_stack.wmx.simulated import rows
from robot_stack.wmx.simulated.homing_types import (
    BACK_FROM_LIMIT,
    CLEAR_HOME_AT_START,
    CLEAR_LIMIT_AT_START,
    SEARCHES,
    Limited,
    Search,
    Until,
)
from robot_stack.wmx.simulated.kernel import begin_stop
from robot_stack.wmx.simulated.parameters import Parameters
from robot_stack.wmx.simulated.profile import plan_position, plan_velocity
from robot_stack.wmx.simulated.state import EngineArrays
from robot_stack.wmx.simulated.switch_kernel import IGNORE_NEGATIVE_END, IGNORE_POSITIVE_END

_NO_ERROR = int(ErrorCode.PyNone)
_HARD_LIMIT = int(ErrorCode.AxisHardLimit)
_TOUCH_PROBE = (Config_HomeType.TouchProbe, Config_HomeType.HSTouchProbe)
_HOME_UNTIL = (Until.HOME_ON, Until.HOME_OFF)
_LIMIT_UNTIL = (Until.LIMIT_ON, Until.LIMIT_OFF)
_LIMIT_ERRORS: Final = {
    Limited.HOME_ON_AT_START: HomeError.MaxHSOnAtStartRevDistanceTraveled,
    Limited.AFTER_LIMIT: HomeError.MaxLSRevDistanceTraveled,
}


@dataclass(slots=True)
class _Run:
    """One axis on its way home.

    ``ahead`` is what is left to look for, the present search first; empty: shifting. ``reached`` is the farthest place
    in the homing direction where the axis has stood.
    """

    param: Config_HomeParam
    script: tuple[Search, ...]
    ahead: list[Search]
    direction: float
    begun_at: float = 0.0
    found: float = 0.0
    reached: float = -math.inf
    was_on: bool = False
    stopping: bool = False
    beyond: bool = False
    turned: bool = False


class Homing:
    """Starts, advances and ends homings. ``device`` is the caller, who owns the axis while it moves."""

    def __init__(self, arrays: EngineArrays, parameters: Parameters, feedback: DriveFeedback) -> None:
        self._a = arrays
        self._parameters = parameters
        self._feedback = feedback
        self._runs: dict[int, _Run] = {}

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
            self._brake(axis, run.param.homingVelocitySlowDec, OperationState.Stop)
        return _NO_ERROR

    def forget(self) -> None:
        """The motion of all axes has been cancelled."""
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
        if kind in _TOUCH_PROBE:
            return CoreMotionErrorCode.TouchProbeDetectionUnsupported
        searches = SEARCHES.get(kind)
        if searches is None:
            return CoreMotionErrorCode.LimitSwitchDetectionUnsupported
        wanted = {search.until for search in searches}
        inp = self._feedback
        if not inp.has_home_switch[axis] and wanted.intersection(_HOME_UNTIL):
            return CoreMotionErrorCode.HomeSwitchDetectionUnsupported
        if not inp.has_limit_switches[axis] and wanted.intersection(_LIMIT_UNTIL):
            return CoreMotionErrorCode.LimitSwitchDetectionUnsupported
        missing = Until.Z_PULSE in wanted and not inp.has_z_pulse[axis]
        return CoreMotionErrorCode.ZPulseDetectionUnsupported if missing else _NO_ERROR

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
        script = SEARCHES[Config_HomeType(param.homeType)]
        direction = 1.0 if param.homeDirection == Config_HomeDirection.Positive else -1.0
        run = _Run(param, script, list(script), direction)
        if script[0].until is Until.HOME_ON and self._a.flags[Flag.HOME_SWITCH, axis]:
            run.ahead.insert(0, CLEAR_HOME_AT_START)
        elif script[0].until is Until.LIMIT_ON and self._limit_on(axis, direction):
            run.ahead.insert(0, CLEAR_LIMIT_AT_START)
        self._runs[axis] = run
        a = self._a
        a.params[rows.PROFILE_DEC, axis] = param.homingVelocitySlowDec
        a.params[rows.PROFILE_DEC_TIME, axis] = 0.0
        a.work[rows.RUN_CYCLES, axis] = 0
        a.work[rows.SERVO_OFF_AT_REST, axis] = 0
        # Both ends: a limit during a homing is the homing's own business.
        a.work[rows.LS_IGNORED, axis] = IGNORE_POSITIVE_END | IGNORE_NEGATIVE_END
        for row in (Flag.MOTION_COMPLETE, Flag.IN_POS, Flag.POS_SET, Flag.END_REASON):
            a.flags[row, axis] = 0
        a.flags[Flag.OWNER, axis] = device
        self._search(axis, run)

    # -- cycle ---------------------------------------------------------------------------------------------------------

    def _step(self, axis: int, run: _Run) -> None:
        flags = self._a.flags
        state = flags[Flag.OP_STATE, axis]
        if self._a.work[rows.STOP_BEGUN, axis]:  # by Cancel or anybody else: over once at rest
            flags[Flag.HOME_STATE, axis] = HomeState.Cancel
        if state == OperationState.Stop:
            return
        at_rest = state == OperationState.Idle
        if flags[Flag.HOME_STATE, axis] == HomeState.Cancel or (at_rest and self._aborted(axis)):
            self._end(axis)
        elif not run.ahead:
            self._shift(axis, run, at_rest)
        elif at_rest:
            self._after_stop(axis, run)
        elif not run.stopping and not run.beyond:
            self._watch(axis, run)

    def _aborted(self, axis: int) -> bool:
        """The drive does not follow any more: an alarm, or its servo is off."""
        flags = self._a.flags
        return bool(flags[Flag.END_REASON, axis] or not flags[Flag.SERVO_ON, axis])

    def _watch(self, axis: int, run: _Run) -> None:
        search = run.ahead[0]
        on, found = self._sensor(axis, run, search)
        hit = {
            Until.HOME_ON: on and not run.was_on,
            Until.HOME_OFF: run.was_on and not on,
            Until.LIMIT_ON: on,
            Until.LIMIT_OFF: not on,
            Until.Z_PULSE: on,
        }[search.until]
        run.was_on = on
        way = self._way(run, search)
        if hit:
            run.found = found
            self._found(axis, run)
        elif self._limit_on(axis, way):
            self._run_into_limit(axis, run)
        elif self._too_far(axis, run, search):
            self._fail(axis, run, _LIMIT_ERRORS[search.limited], _NO_ERROR)

    def _sensor(self, axis: int, run: _Run, search: Search) -> tuple[bool, float]:
        """The sensor looked for, and the position to remember if this is it."""
        here = float(self._a.reals[Real.ACTUAL_POS, axis])
        if search.until is Until.Z_PULSE:
            scale, offset = self._a.params[rows.COUNTS_PER_UNIT, axis], self._a.reals[Real.HOME_OFFSET, axis]
            return bool(self._feedback.z_pulse[axis]), float(self._feedback.z_pulse_counts[axis] / scale - offset)
        if search.until in _LIMIT_UNTIL:
            return self._limit_on(axis, run.direction), here
        return bool(self._a.flags[Flag.HOME_SWITCH, axis]), here

    def _limit_on(self, axis: int, direction: float) -> bool:
        """The limit switch at that end of travel."""
        named_positive = (direction > 0.0) == (self._a.work[rows.LS_REVERSED, axis] == 0)
        present = self._feedback.has_limit_switches[axis]
        return bool(present and self._a.flags[Flag.POSITIVE_LS if named_positive else Flag.NEGATIVE_LS, axis])

    def _too_far(self, axis: int, run: _Run, search: Search) -> bool:
        param = run.param
        limits = {
            Limited.HOME_ON_AT_START: param.maxHSOnAtStartReverseDistance,
            Limited.AFTER_LIMIT: param.maxLSReverseDistance,
        }
        limit = limits.get(search.limited, 0.0)
        return limit > 0.0 and abs(float(self._a.reals[Real.POS_CMD, axis]) - run.begun_at) > limit

    def _found(self, axis: int, run: _Run) -> None:
        """The present search has succeeded: on with the next, at once if it goes the same way."""
        search = run.ahead[0]
        following = run.ahead[1] if len(run.ahead) > 1 else None
        if following is not None and following.reverse == search.reverse and not search.beyond:
            run.ahead.pop(0)
            self._search(axis, run)
        else:
            run.stopping = True
            self._brake(axis, self._speeds(run, search)[2], OperationState.Home)

    def _after_stop(self, axis: int, run: _Run) -> None:
        run.reached = max(run.reached, run.direction * float(self._a.reals[Real.POS_CMD, axis]))
        search = run.ahead[0]
        if search.beyond and not run.beyond and run.param.homingReverseDistance > 0.0:
            run.beyond = True
            way = self._way(run, search) * run.param.homingReverseDistance
            velocity, acc, dec = self._speeds(run, search)
            self._go(axis, float(self._a.reals[Real.POS_CMD, axis]) + way, velocity, acc, dec)
            return
        run.stopping = run.beyond = False
        run.ahead.pop(0)
        if run.ahead:
            self._search(axis, run)
        else:
            self._begin_shift(axis, run)

    def _run_into_limit(self, axis: int, run: _Run) -> None:
        search = run.ahead[0]
        turns = run.script[0].until in _HOME_UNTIL and not search.reverse and not run.turned
        if not turns:
            self._fail(axis, run, HomeError.LSTriggered, _HARD_LIMIT)
            return
        run.turned = True
        # The search that failed is the first to go once the axis stands.
        run.ahead = [search, BACK_FROM_LIMIT, *run.script]
        run.stopping = True
        self._brake(axis, self._speeds(run, search)[2], OperationState.Home)

    def _fail(self, axis: int, run: _Run, error: HomeError, reason: int) -> None:
        self._a.flags[Flag.HOME_ERROR, axis] = error
        self._a.flags[Flag.HOME_STATE, axis] = HomeState.Cancel
        self._brake(axis, self._speeds(run, run.ahead[0])[2], OperationState.Stop)
        self._a.flags[Flag.END_REASON, axis] = reason

    # -- the way from what was found to home ---------------------------------------------------------------------------

    def _begin_shift(self, axis: int, run: _Run) -> None:
        run.found += run.direction * run.param.homeShiftDistance
        self._a.flags[Flag.HOME_STATE, axis] = HomeState.HomeShift
        param = run.param
        self._go(axis, run.found, param.homeShiftVelocity, param.homeShiftAcc, param.homeShiftDec)

    def _shift(self, axis: int, run: _Run, at_rest: bool) -> None:
        if at_rest:
            self._a.flags[Flag.MOTION_COMPLETE, axis] = 1
            self._end(axis)
            self._arrive(axis, run.param.homePosition)
            return
        velocity = float(self._a.reals[Real.VELOCITY_CMD, axis])
        known = run.direction * velocity > 0.0 and run.direction * run.found <= run.reached
        if velocity and not known and self._limit_on(axis, velocity):
            self._a.flags[Flag.HOME_ERROR, axis] = HomeError.LSTriggered
            self._a.flags[Flag.HOME_STATE, axis] = HomeState.Cancel
            self._brake(axis, run.param.homeShiftDec, OperationState.Stop)
            self._a.flags[Flag.END_REASON, axis] = _HARD_LIMIT

    def _arrive(self, axis: int, position: float) -> None:
        rename(self._a, axis, Real.POS_CMD, position)
        self._a.flags[Flag.HOME_DONE, axis] = 1

    def _end(self, axis: int) -> None:
        del self._runs[axis]
        self._a.flags[Flag.HOME_STATE, axis] = HomeState.Idle
        self._a.work[rows.LS_IGNORED, axis] = 0

    # -- motion --------------------------------------------------------------------------------------------------------

    @staticmethod
    def _way(run: _Run, search: Search) -> float:
        return -run.direction if search.reverse else run.direction

    @staticmethod
    def _speeds(run: _Run, search: Search) -> tuple[float, float, float]:
        """Velocity, acceleration and deceleration of a search."""
        p = run.param
        if search.slow:
            return p.homingVelocitySlow, p.homingVelocitySlowAcc, p.homingVelocitySlowDec
        return p.homingVelocityFast, p.homingVelocityFastAcc, p.homingVelocityFastDec

    def _search(self, axis: int, run: _Run) -> None:
        search = run.ahead[0]
        a = self._a
        position, velocity = float(a.reals[Real.POS_CMD, axis]), float(a.reals[Real.VELOCITY_CMD, axis])
        speed, acc, dec = self._speeds(run, search)
        run.begun_at = position
        run.was_on = bool(a.flags[Flag.HOME_SWITCH, axis]) if search.until in _HOME_UNTIL else False
        wanted = self._way(run, search) * speed
        a.work[rows.SEGMENTS, axis] = plan_velocity(a.plan[axis], position, velocity, wanted, acc, dec)
        a.flags[Flag.HOME_STATE, axis] = search.state
        self._moving(axis)

    def _go(self, axis: int, target: float, speed: float, acc: float, dec: float) -> None:
        a = self._a
        position, velocity = float(a.reals[Real.POS_CMD, axis]), float(a.reals[Real.VELOCITY_CMD, axis])
        overtravel = int(a.work[rows.OVERTRAVEL, axis])
        n = plan_position(a.plan[axis], position, velocity, target, speed, acc, dec, overtravel)
        a.work[rows.SEGMENTS, axis] = n
        a.reals[Real.PROFILE_TARGET_POS, axis] = target
        self._moving(axis)

    def _moving(self, axis: int) -> None:
        a = self._a
        a.work[rows.TICK, axis] = 0
        a.work[rows.STOP_BEGUN, axis] = 0
        a.flags[Flag.OP_STATE, axis] = OperationState.Home
        a.flags[Flag.DETAIL_OP_STATE, axis] = DetailOperationState.Home
        a.flags[Flag.CMD_DISTRIBUTION_END, axis] = 0

    def _brake(self, axis: int, dec: float, state: OperationState) -> None:
        """To rest at ``dec``, as a part of the homing (state Home) or as its end (state Stop)."""
        a = self._a
        if a.flags[Flag.OP_STATE, axis] == OperationState.Stop:
            return
        begin_stop(a.reals, a.flags, a.work, a.plan, axis, float(dec), int(DetailOperationState.Stop), _NO_ERROR)
        if state is OperationState.Home:
            a.work[rows.STOP_BEGUN, axis] = 0
            a.flags[Flag.OP_STATE, axis] = OperationState.Home
            a.flags[Flag.DETAIL_OP_STATE, axis] = DetailOperationState.Home


def rename(a: EngineArrays, axis: int, row: Real, position: float) -> None:
    """Shifts the user positions of an axis so that ``row`` reads ``position``; encoder counts stay."""
    reals = a.reals
    shift = position - reals[row, axis]
    reals[Real.HOME_OFFSET, axis] -= shift
    for shifted in (Real.POS_CMD, Real.ACTUAL_POS, Real.PROFILE_TARGET_POS):
        reals[shifted, axis] += shift
    reals[row, axis] = position

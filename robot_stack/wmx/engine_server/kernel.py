"""The engine's work for every axis in every cycle, compiled.

``advance`` turns plans into drive commands, ``absorb`` turns drive feedback into status and reacts to it. Between them
lies the bus. The state is a struct of arrays:

    reals   (N_REALS, n) float64   status, user units         rows: robot_stack.wmx.axes.Real
    flags   (N_FLAGS, n) int64     status                     rows: robot_stack.wmx.axes.Flag
    params  (N_PARAMS, n) float64  parameters, user units     rows: robot_stack.wmx.engine_server.rows
    work    (N_WORK, n) int64      private counters           rows: robot_stack.wmx.engine_server.rows
    plan    (n, MAX_SEGMENTS, 4)   present motion             robot_stack.wmx.engine_server.profile
"""

from __future__ import annotations

import math
from typing import Final

from robot_stack.core.compiled import compiled
from robot_stack.wmx.api.enums import AxisCommandMode, Config_LimitSwitchType, DetailOperationState, OperationState
from robot_stack.wmx.api.errors import ErrorCode
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.bus import DriveCommands, DriveFeedback
from robot_stack.wmx.engine_server import rows
from robot_stack.wmx.engine_server.profile import evaluate, plan_stop, remaining
from robot_stack.wmx.engine_server.state import EngineArrays, Ints, Reals

# Compiled code needs plain integers.
POS_CMD: Final = int(Real.POS_CMD)
ACTUAL_POS: Final = int(Real.ACTUAL_POS)
VELOCITY_CMD: Final = int(Real.VELOCITY_CMD)
ACTUAL_VELOCITY: Final = int(Real.ACTUAL_VELOCITY)
ACTUAL_TORQUE: Final = int(Real.ACTUAL_TORQUE)
TARGET: Final = int(Real.PROFILE_TARGET_POS)
REMAINING_MS: Final = int(Real.PROFILE_REMAINING_MS)
CMD_ACC: Final = int(Real.CMD_ACC)
HOME_OFFSET: Final = int(Real.HOME_OFFSET)
FOLLOWING_ERROR: Final = int(Real.FOLLOWING_ERROR)

SERVO_ON: Final = int(Flag.SERVO_ON)
SERVO_REQUESTED: Final = int(Flag.SERVO_REQUESTED)
SERVO_OFFLINE: Final = int(Flag.SERVO_OFFLINE)
AMP_ALARM: Final = int(Flag.AMP_ALARM)
AMP_ALARM_CODE: Final = int(Flag.AMP_ALARM_CODE)
ERROR_ALARM: Final = int(Flag.FOLLOWING_ERROR_ALARM)
OP_STATE: Final = int(Flag.OP_STATE)
DETAIL: Final = int(Flag.DETAIL_OP_STATE)
MODE: Final = int(Flag.COMMAND_MODE)
COMMAND_READY: Final = int(Flag.COMMAND_READY)
MOTION_COMPLETE: Final = int(Flag.MOTION_COMPLETE)
IN_POS: Final = int(Flag.IN_POS)
DISTRIBUTED: Final = int(Flag.CMD_DISTRIBUTION_END)
POS_SET: Final = int(Flag.POS_SET)
DELAYED_POS_SET: Final = int(Flag.DELAYED_POS_SET)
POSITIVE_SOFT_LIMIT: Final = int(Flag.POSITIVE_SOFT_LIMIT)
NEGATIVE_SOFT_LIMIT: Final = int(Flag.NEGATIVE_SOFT_LIMIT)
HOME_DONE: Final = int(Flag.HOME_DONE)
ACC_FLAG: Final = int(Flag.ACC_FLAG)
DEC_FLAG: Final = int(Flag.DEC_FLAG)
ENCODER_COMMAND: Final = int(Flag.ENCODER_COMMAND)
ENCODER_FEEDBACK: Final = int(Flag.ENCODER_FEEDBACK)
END_REASON: Final = int(Flag.END_REASON)

IDLE: Final = int(OperationState.Idle)
POS: Final = int(OperationState.Pos)
STOP: Final = int(OperationState.Stop)
VELOCITY: Final = int(OperationState.Velocity)
DETAIL_IDLE: Final = int(DetailOperationState.Idle)
DETAIL_STOP: Final = int(DetailOperationState.Stop)
DETAIL_QUICK_STOP: Final = int(DetailOperationState.Stop_QStop)
DETAIL_ESTOP: Final = int(DetailOperationState.Stop_EStop)
POSITION_MODE: Final = int(AxisCommandMode.Position)
REASON_SERVO_OFF: Final = int(ErrorCode.ServoOff)
REASON_ALARM: Final = int(ErrorCode.AxisAmpAlarm)
REASON_SOFT_LIMIT: Final = int(ErrorCode.AxisSoftLimit)
LIMIT_NONE: Final = int(Config_LimitSwitchType.PyNone)
LIMIT_SERVO_OFF: Final = int(Config_LimitSwitchType.ServoOff)
LIMIT_DEC_SERVO_OFF: Final = int(Config_LimitSwitchType.DecServoOff)
LIMIT_SLOW_DEC_SERVO_OFF: Final = int(Config_LimitSwitchType.SlowDecServoOff)
LIMIT_SLOW_DEC: Final = int(Config_LimitSwitchType.SlowDec)


@compiled
def stop_rate(params: Reals, i: int, speed: float) -> float:
    """Deceleration of the running command's own profile from ``speed``; 0 is a stop in one cycle."""
    time: float = params[rows.PROFILE_DEC_TIME, i]
    dec: float = params[rows.PROFILE_DEC, i]
    return speed / time if time > 0.0 else dec


@compiled
def begin_stop(
    reals: Reals, flags: Ints, work: Ints, plan: Reals, i: int, dec: float, detail: int, reason: int
) -> None:
    """Ends the running motion of axis ``i`` by a ramp at ``dec`` (0: in one cycle); then the axis is idle.

    An axis that a spline carries leaves its path.
    """
    work[rows.SPLINE, i] = 0
    work[rows.SEGMENTS, i] = plan_stop(plan[i], reals[POS_CMD, i], reals[VELOCITY_CMD, i], dec)
    work[rows.TICK, i] = 0
    work[rows.RUN_CYCLES, i] = 0
    end, _, _, _ = evaluate(plan[i], work[rows.SEGMENTS, i], math.inf)
    reals[TARGET, i] = reals[POS_CMD, i] if math.isnan(end) else end
    flags[OP_STATE, i] = STOP
    flags[DETAIL, i] = detail
    flags[MOTION_COMPLETE, i] = 0
    flags[DISTRIBUTED, i] = 0
    if reason != 0:
        flags[END_REASON, i] = reason


@compiled
def estop_axes(reals: Reals, flags: Ints, params: Reals, work: Ints, plan: Reals, servo_off: bool) -> None:
    """Ends every motion at the emergency deceleration, or at the present one where that is harder."""
    for i in range(flags.shape[1]):
        if flags[OP_STATE, i] != IDLE and flags[DETAIL, i] != DETAIL_ESTOP:
            dec = params[rows.ESTOP_DEC, i]
            if flags[OP_STATE, i] == STOP:
                dec = max(dec, abs(reals[CMD_ACC, i]))
            begin_stop(reals, flags, work, plan, i, dec, DETAIL_ESTOP, 0)
        if servo_off:
            if flags[OP_STATE, i] == IDLE:
                flags[SERVO_REQUESTED, i] = 0
            else:
                work[rows.SERVO_OFF_AT_REST, i] = 1


@compiled
def cancel(reals: Reals, flags: Ints, work: Ints, i: int, reason: int) -> None:
    """Ends the motion of axis ``i`` at once, without a ramp: its drive does not follow any more."""
    if flags[OP_STATE, i] != IDLE:
        flags[MOTION_COMPLETE, i] = 0
        flags[END_REASON, i] = reason
    flags[OP_STATE, i] = IDLE
    flags[DETAIL, i] = DETAIL_IDLE
    flags[DISTRIBUTED, i] = 1
    work[rows.SPLINE, i] = 0
    work[rows.SEGMENTS, i] = 0
    work[rows.RUN_CYCLES, i] = 0
    work[rows.SERVO_OFF_AT_REST, i] = 0
    reals[VELOCITY_CMD, i] = 0.0
    reals[CMD_ACC, i] = 0.0
    reals[REMAINING_MS, i] = 0.0
    reals[TARGET, i] = reals[POS_CMD, i]


@compiled
def _step(reals: Reals, flags: Ints, params: Reals, work: Ints, plan: Reals, i: int, dt: float) -> None:
    """One cycle of the plan of a moving axis."""
    if work[rows.RUN_CYCLES, i] > 0:
        work[rows.RUN_CYCLES, i] -= 1
        if work[rows.RUN_CYCLES, i] == 0:
            begin_stop(reals, flags, work, plan, i, stop_rate(params, i, abs(reals[VELOCITY_CMD, i])), DETAIL_STOP, 0)
    work[rows.TICK, i] += 1
    t = work[rows.TICK, i] * dt
    position, velocity, acceleration, ended = evaluate(plan[i], work[rows.SEGMENTS, i], t)
    reals[VELOCITY_CMD, i] = velocity
    reals[CMD_ACC, i] = acceleration
    if not ended:
        reals[POS_CMD, i] = position
        reals[REMAINING_MS, i] = 1e3 * remaining(plan[i], work[rows.SEGMENTS, i], t)
        return
    reals[POS_CMD, i] = reals[TARGET, i]
    reals[REMAINING_MS, i] = 0.0
    flags[MOTION_COMPLETE, i] = 1 if flags[OP_STATE, i] == POS else 0
    flags[OP_STATE, i] = IDLE
    flags[DETAIL, i] = DETAIL_IDLE
    flags[DISTRIBUTED, i] = 1
    if work[rows.SERVO_OFF_AT_REST, i] != 0:
        work[rows.SERVO_OFF_AT_REST, i] = 0
        flags[SERVO_REQUESTED, i] = 0


@compiled
def advance(arrays: EngineArrays, dt: float, out: DriveCommands) -> None:
    """One cycle of every axis: fills the drive commands."""
    reals, flags, params, work, plan = arrays
    servo_on, mode, position_counts, velocity_counts_per_s, clear_alarm, _ = out
    for i in range(flags.shape[1]):
        mode[i] = flags[MODE, i]
        if flags[SERVO_REQUESTED, i] == 0:
            servo_on[i] = False
        elif work[rows.SERVO_DELAY, i] > 0:
            work[rows.SERVO_DELAY, i] -= 1
        else:
            servo_on[i] = True
        clear_alarm[i] = work[rows.CLEAR_CYCLES, i] > 0
        if clear_alarm[i]:
            work[rows.CLEAR_CYCLES, i] -= 1
        if flags[SERVO_ON, i] != 0 and flags[OP_STATE, i] != IDLE:
            if work[rows.SPLINE, i] == 0:  # else the spline has moved it already
                _step(reals, flags, params, work, plan, i, dt)
        else:
            reals[VELOCITY_CMD, i] = 0.0
            reals[CMD_ACC, i] = 0.0
        speeding = reals[CMD_ACC, i] * reals[VELOCITY_CMD, i]
        flags[ACC_FLAG, i] = 1 if speeding > 0.0 else 0
        flags[DEC_FLAG, i] = 1 if speeding < 0.0 else 0
        scale = params[rows.COUNTS_PER_UNIT, i]
        if flags[SERVO_ON, i] == 0 or flags[MODE, i] != POSITION_MODE:
            reals[POS_CMD, i] = reals[ACTUAL_POS, i]
            flags[ENCODER_COMMAND, i] = flags[ENCODER_FEEDBACK, i]
        else:
            flags[ENCODER_COMMAND, i] = math.floor((reals[POS_CMD, i] + reals[HOME_OFFSET, i]) * scale + 0.5)
        position_counts[i] = flags[ENCODER_COMMAND, i]
        velocity_counts_per_s[i] = reals[VELOCITY_CMD, i] * scale


@compiled
def _servo_edges(reals: Reals, flags: Ints, work: Ints, i: int, on: bool) -> None:
    """Takes over the drive's servo state: off ends motion, on starts from where the axis is."""
    if on and flags[SERVO_ON, i] == 0:
        flags[SERVO_ON, i] = 1
        flags[END_REASON, i] = 0
        reals[POS_CMD, i] = reals[ACTUAL_POS, i]
        cancel(reals, flags, work, i, 0)
    elif not on and flags[SERVO_ON, i] != 0:
        flags[SERVO_ON, i] = 0
        cancel(reals, flags, work, i, REASON_SERVO_OFF)
        if flags[SERVO_REQUESTED, i] != 0:  # dropped without a request: it must not return by itself
            flags[SERVO_REQUESTED, i] = 0
            flags[END_REASON, i] = REASON_SERVO_OFF
        if work[rows.UNHOME_ON_SERVO_OFF, i] != 0:
            flags[HOME_DONE, i] = 0
    if not on:
        reals[POS_CMD, i] = reals[ACTUAL_POS, i]
        reals[TARGET, i] = reals[ACTUAL_POS, i]


@compiled
def _following_error(reals: Reals, flags: Ints, params: Reals, work: Ints, plan: Reals, i: int) -> None:
    """Monitors command against feedback of a servo-on axis; latches the alarm and stops the axis if configured."""
    moving = flags[OP_STATE, i] != IDLE
    tripped = False
    stops = 0
    if flags[MODE, i] == POSITION_MODE:
        width = params[rows.ERROR_MOVING, i] if moving else params[rows.ERROR_STOPPED, i]
        tripped = width > 0.0 and abs(reals[FOLLOWING_ERROR, i]) > width
        stops = work[rows.ERROR_STOPS, i]
    if not tripped:
        width = params[rows.VELOCITY_ERROR_MOVING, i] if moving else params[rows.VELOCITY_ERROR_STOPPED, i]
        limit = work[rows.VELOCITY_ERROR_MOVING_CYCLES, i] if moving else work[rows.VELOCITY_ERROR_STOPPED_CYCLES, i]
        if width > 0.0 and abs(reals[VELOCITY_CMD, i] - reals[ACTUAL_VELOCITY, i]) > width:
            work[rows.VELOCITY_ERROR_COUNT, i] += 1
        else:
            work[rows.VELOCITY_ERROR_COUNT, i] = 0
        tripped = width > 0.0 and work[rows.VELOCITY_ERROR_COUNT, i] > limit
        stops = work[rows.VELOCITY_ERROR_STOPS, i]
    if tripped and flags[ERROR_ALARM, i] == 0:
        flags[ERROR_ALARM, i] = 1
        if stops != 0 and moving and flags[DETAIL, i] != DETAIL_ESTOP:
            begin_stop(reals, flags, work, plan, i, params[rows.QUICK_STOP_DEC, i], DETAIL_QUICK_STOP, REASON_ALARM)


@compiled
def _soft_limits(reals: Reals, flags: Ints, params: Reals, work: Ints, plan: Reals, i: int) -> None:
    """Handles the edge of a limit; a motion away from it is free."""
    positive, negative = work[rows.SOFT_POSITIVE_TYPE, i], work[rows.SOFT_NEGATIVE_TYPE, i]
    homed = flags[HOME_DONE, i] != 0
    position = reals[POS_CMD, i]
    high = (
        homed
        and positive != LIMIT_NONE
        and params[rows.SOFT_POSITIVE, i] != 0.0
        and position > params[rows.SOFT_POSITIVE, i]
    )
    low = (
        homed
        and negative != LIMIT_NONE
        and params[rows.SOFT_NEGATIVE, i] != 0.0
        and position < params[rows.SOFT_NEGATIVE, i]
    )
    flags[POSITIVE_SOFT_LIMIT, i] = 1 if high else 0
    flags[NEGATIVE_SOFT_LIMIT, i] = 1 if low else 0
    velocity = reals[VELOCITY_CMD, i]
    if flags[OP_STATE, i] == IDLE or flags[OP_STATE, i] == STOP:
        return
    if not ((high and velocity > 0.0) or (low and velocity < 0.0)):
        return
    kind = positive if velocity > 0.0 else negative
    slow = kind in (LIMIT_SLOW_DEC, LIMIT_SLOW_DEC_SERVO_OFF)
    dec = params[rows.LS_SLOW_DEC, i] if slow else params[rows.LS_DEC, i]
    begin_stop(reals, flags, work, plan, i, dec, DETAIL_STOP, REASON_SOFT_LIMIT)
    if kind == LIMIT_SERVO_OFF:
        flags[SERVO_REQUESTED, i] = 0
    if kind in (LIMIT_DEC_SERVO_OFF, LIMIT_SLOW_DEC_SERVO_OFF):
        work[rows.SERVO_OFF_AT_REST, i] = 1


@compiled
def _arrival(reals: Reals, flags: Ints, params: Reals, work: Ints, i: int) -> None:
    """Flags that compare the feedback with the target of the present command."""
    away = abs(reals[ACTUAL_POS, i] - reals[TARGET, i])
    in_velocity = flags[OP_STATE, i] == VELOCITY
    flags[IN_POS, i] = 1 if not in_velocity and away <= params[rows.IN_POS_WIDTH, i] else 0
    distributed = flags[DISTRIBUTED, i] != 0
    flags[POS_SET, i] = 1 if distributed and away <= params[rows.POS_SET_WIDTH, i] else 0
    if distributed and away <= params[rows.DELAYED_POS_SET_WIDTH, i]:
        work[rows.DELAYED_POS_SET_COUNT, i] += 1
    else:
        work[rows.DELAYED_POS_SET_COUNT, i] = 0
    reached = work[rows.DELAYED_POS_SET_COUNT, i] > work[rows.DELAYED_POS_SET_CYCLES, i]
    flags[DELAYED_POS_SET, i] = 1 if reached else 0


@compiled
def absorb(arrays: EngineArrays, stopped: bool, inp: DriveFeedback) -> None:
    """Reads one cycle's feedback of every axis. ``stopped``: an emergency stop is active."""
    reals, flags, params, work, plan = arrays
    position_counts, velocity_counts_per_s, torque_percent, servo_on, alarm_code, _ = inp
    for i in range(flags.shape[1]):
        scale = params[rows.COUNTS_PER_UNIT, i]
        flags[SERVO_OFFLINE, i] = 0
        flags[ENCODER_FEEDBACK, i] = position_counts[i]
        reals[ACTUAL_POS, i] = position_counts[i] / scale - reals[HOME_OFFSET, i]
        reals[ACTUAL_VELOCITY, i] = velocity_counts_per_s[i] / scale
        reals[ACTUAL_TORQUE, i] = math.copysign(1.0, scale) * torque_percent[i]
        _servo_edges(reals, flags, work, i, servo_on[i])
        flags[AMP_ALARM_CODE, i] = alarm_code[i]
        flags[AMP_ALARM, i] = 1 if alarm_code[i] != 0 else 0
        if alarm_code[i] != 0:
            cancel(reals, flags, work, i, REASON_ALARM)
            if work[rows.SERVO_OFF_ON_ALARM, i] != 0:
                flags[SERVO_REQUESTED, i] = 0
        in_position_mode = flags[MODE, i] == POSITION_MODE
        reals[FOLLOWING_ERROR, i] = reals[POS_CMD, i] - reals[ACTUAL_POS, i] if in_position_mode else 0.0
        if flags[SERVO_ON, i] != 0:
            if not in_position_mode:
                reals[POS_CMD, i] = reals[ACTUAL_POS, i]
                if flags[OP_STATE, i] == IDLE:
                    reals[TARGET, i] = reals[ACTUAL_POS, i]
            _following_error(reals, flags, params, work, plan, i)
            _soft_limits(reals, flags, params, work, plan, i)
        _arrival(reals, flags, params, work, i)
        healthy = flags[SERVO_ON, i] != 0 and flags[AMP_ALARM, i] == 0 and flags[ERROR_ALARM, i] == 0
        flags[COMMAND_READY, i] = 1 if healthy and not stopped and flags[OP_STATE, i] != STOP else 0

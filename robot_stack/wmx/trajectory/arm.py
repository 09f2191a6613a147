"""The arm's state from its axes, and its requests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.api import AxisCommandMode, CoreMotionErrorCode, ErrorCode, OperationState, error_name
from robot_stack.wmx.axes import Flag, StatusSnapshot
from robot_stack.wmx.trajectory.results import Fault
from robot_stack.wmx.trajectory.spline import ClampedSpline

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class ArmState:
    """One status of the arm. Arrays are (joints,) in the order of the axes; rad, rad/s. time_s: the engine's own."""

    time_s: float
    communicating: bool
    emergency_stop: bool
    command: FloatArray
    position: FloatArray
    command_velocity: FloatArray
    velocity: FloatArray
    idle: BoolArray
    complete: BoolArray
    position_mode: BoolArray
    servo_on: BoolArray
    alarm: BoolArray
    alarm_code: NDArray[np.int64]
    following_error: BoolArray
    end_reason: NDArray[np.int64]
    """Code of the end of each axis' last motion, if the engine reports it; 0 for a normal end and for a stop."""


@dataclass(frozen=True, slots=True)
class Blind:
    """No valid status. gone: the engine has ended, or closed the device; otherwise it may be paused."""

    fault: Fault
    gone: bool


class Arm(Protocol):
    """Requests are executed or refused at once; a refusal is returned."""

    def start(self, spline: ClampedSpline) -> Fault | None:
        """Starts the spline; its first point is the present position."""
        ...

    def stop(self) -> Fault | None:
        """Stops all axes along the path."""
        ...

    def quick_stop(self) -> Fault | None:
        """Stops all axes at their quick-stop deceleration."""
        ...


def arm_state(snapshot: StatusSnapshot, n_joints: int) -> ArmState:
    """The first ``n_joints`` axes of a status."""
    axes = slice(0, n_joints)
    return ArmState(
        time_s=snapshot.engine_time_s,
        communicating=snapshot.communicating,
        emergency_stop=snapshot.emergency_stop,
        command=snapshot.pos_cmd[axes],
        position=snapshot.actual_pos[axes],
        command_velocity=snapshot.velocity_cmd[axes],
        velocity=snapshot.actual_velocity[axes],
        idle=np.asarray(snapshot.op_state[axes] == OperationState.Idle),
        complete=snapshot.motion_complete[axes],
        position_mode=np.asarray(snapshot.command_mode[axes] == AxisCommandMode.Position),
        servo_on=snapshot.servo_on[axes],
        alarm=snapshot.amp_alarm[axes],
        alarm_code=snapshot.amp_alarm_code[axes],
        following_error=snapshot.following_error_alarm[axes],
        end_reason=snapshot.flags[Flag.END_REASON][axes],
    )


def fault_of(state: ArmState, joints: tuple[str, ...]) -> Fault | None:
    """The reason if this arm cannot start or continue a motion, else None."""
    if not state.communicating:
        return Fault(ErrorCode.CommNotStarted, "no communication with the drives")
    if state.emergency_stop:
        return Fault(CoreMotionErrorCode.EmergencyStopSignalOn, "the engine's emergency stop is active")
    for axis in np.flatnonzero(state.alarm):
        return Fault(ErrorCode.AxisAmpAlarm, f"{joints[axis]}: amplifier alarm 0x{int(state.alarm_code[axis]):04X}")
    for axis in np.flatnonzero(state.following_error):
        return Fault(ErrorCode.AxisAmpAlarm, f"{joints[axis]}: following error alarm")
    for axis in np.flatnonzero(~state.servo_on):
        return Fault(ErrorCode.ServoOff, f"{joints[axis]}: the servo is off")
    return None


def not_ready(state: ArmState, joints: tuple[str, ...]) -> Fault | None:
    """The reason if a motion cannot start, else None."""
    fault = fault_of(state, joints)
    if fault is not None:
        return fault
    for axis in np.flatnonzero(~state.position_mode):
        return Fault(CoreMotionErrorCode.NotPosMode, f"{joints[axis]}: is not in position mode")
    for axis in np.flatnonzero(~state.idle):
        return Fault(ErrorCode.NotIdleState, f"{joints[axis]}: is being moved by another client")
    return None


def end_fault(state: ArmState, joints: tuple[str, ...]) -> Fault:
    """The reason for the end of an incomplete motion."""
    for axis in np.flatnonzero(state.end_reason):
        code = int(state.end_reason[axis])
        return Fault(code, f"{joints[axis]}: stopped by the engine, {error_name(code)}")
    names = ", ".join(joints[axis] for axis in np.flatnonzero(~state.complete))
    return Fault(ErrorCode.NoMotion, f"stopped by another client before the end: {names}")

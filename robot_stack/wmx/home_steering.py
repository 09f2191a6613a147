"""Homes the robot's steering axes, by an operator's command while the drive holds them with servos on.

An axis without a home does not move, nor does one that was homed, until an emergency stop (``drive.session``). How its
zero is found is a parameter of the axis, imported by the drive: the present heading, or the drive's home switch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import ErrorCode, OperationState, error_name
from robot_stack.wmx.axes import Real, StatusSnapshot
from robot_stack.wmx.homing import homed

_POLL_S: Final = 0.03  # no multiple or part of the drive's 50 ms
_STANDSTILL_RADPS: Final = 0.02


class HomingError(Exception):
    """The axes cannot be homed, or were not; the text says why."""


def home_axes(
    engine: MotionEngine,
    axes: Mapping[int, str],
    machine: Mapping[int, str],
    *,
    pause: Callable[[float], None],
    timeout_s: float,
) -> dict[str, float]:
    """Homes ``axes`` together. Returns the home offset of each by name, rad: ``zero_rad`` of an absolute encoder.

    machine: all axes of the robot, which must stand. pause: waits for so many seconds. Raises HomingError; the homing
    of axes that have not finished is then cancelled.
    """
    _require(_status(engine), axes, machine)
    left: list[int] = []
    waiting = list(axes)
    try:
        for _ in range(max(1, round(timeout_s / _POLL_S))):
            for axis in tuple(waiting):
                code = engine.core_motion.home.StartHome(axis)
                if code != ErrorCode.NotIdleState:  # the drive, which holds the axis, commands it at this moment
                    left.append(axis)
                    _checked(axes[axis], code)
                    waiting.remove(axis)
            pause(_POLL_S)
            snapshot = _status(engine)
            left = [axis for axis in left if not _homed(snapshot, axis, axes[axis])]
            if not left and not waiting:
                offsets = snapshot.reals[Real.HOME_OFFSET]
                return {name: float(offsets[axis]) for axis, name in axes.items()}
        raise HomingError(f"not homed within {timeout_s:g} s: {', '.join(axes[axis] for axis in (*left, *waiting))}")
    finally:  # also after an interruption: an axis may be turning towards its switch
        for axis in left:
            engine.core_motion.home.Cancel(axis)


def _status(engine: MotionEngine) -> StatusSnapshot:
    code, snapshot = engine.read_status()
    _checked("engine status", code)
    return snapshot


def _checked(what: str, code: int) -> None:
    if code:
        raise HomingError(f"{what}: {error_name(code)} (error {code})")


def _homed(snapshot: StatusSnapshot, axis: int, name: str) -> bool:
    code = homed(lambda: False, snapshot, axis)
    _checked(name, code or 0)
    return code is not None


def _stands(snapshot: StatusSnapshot, axis: int) -> bool:
    at_rest = snapshot.held_at_zero(axis) or snapshot.op_state[axis] == OperationState.Idle
    return bool(at_rest and abs(snapshot.actual_velocity[axis]) <= _STANDSTILL_RADPS)


def _require(snapshot: StatusSnapshot, axes: Mapping[int, str], machine: Mapping[int, str]) -> None:
    if not snapshot.communicating:
        raise HomingError("the engine does not communicate: start the robot's profile first")
    if snapshot.n_axes <= max(machine):
        raise HomingError(f"axis {max(machine)} of an engine with {snapshot.n_axes}")
    if snapshot.emergency_stop:
        raise HomingError("the engine is in emergency stop: release it first, robot-stack reset")
    off = [name for axis, name in axes.items() if not snapshot.servo_on[axis]]
    if off:
        raise HomingError(f"servo off: {', '.join(off)}; the drive switches them on, robot-stack status")
    moving = [name for axis, name in machine.items() if not _stands(snapshot, axis)]
    if moving:
        raise HomingError(f"the robot must stand, these move: {', '.join(moving)}")

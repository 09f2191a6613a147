"""The port on the vendor's library: delegation, and the few shapes in which its versions differ.

The vendor's calls want the vendor's own value objects; those of the port are copied into them field by field. Records
that the vendor returns have the port's names and are passed through. Written against the published surface of engine
version 3.5 and not yet run on a machine that has one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from types import ModuleType
from typing import Any, Final, cast

import numpy as np

from robot_stack.wmx.api.enums import EngineState
from robot_stack.wmx.api.values import AxisSelection, Profile
from robot_stack.wmx.axes import Flag, Real, StatusSnapshot, empty_snapshot

COMMANDS: Final = (
    "Motion_PosCommand",
    "Motion_JogCommand",
    "Motion_TimedJogCommand",
    "Velocity_VelCommand",
    "Velocity_TimedVelCommand",
)

_FLAGS: Final = {
    Flag.SERVO_ON: "servoOn",
    Flag.SERVO_REQUESTED: "servoOn",  # the vendor does not tell what was asked for
    Flag.SERVO_OFFLINE: "servoOffline",
    Flag.AMP_ALARM: "ampAlarm",
    Flag.AMP_ALARM_CODE: "ampAlarmCode",
    Flag.FOLLOWING_ERROR_ALARM: "followingErrorAlarm",
    Flag.OP_STATE: "opState",
    Flag.DETAIL_OP_STATE: "detailOpState",
    Flag.COMMAND_MODE: "axisCommandMode",
    Flag.COMMAND_READY: "commandReady",
    Flag.MOTION_COMPLETE: "motionComplete",
    Flag.IN_POS: "inPos",
    Flag.CMD_DISTRIBUTION_END: "cmdDistributionEnd",
    Flag.POS_SET: "posSet",
    Flag.DELAYED_POS_SET: "delayedPosSet",
    Flag.POSITIVE_SOFT_LIMIT: "positiveSoftLimit",
    Flag.NEGATIVE_SOFT_LIMIT: "negativeSoftLimit",
    Flag.HOME_STATE: "homeState",
    Flag.HOME_DONE: "homeDone",
    Flag.ACC_FLAG: "accFlag",
    Flag.DEC_FLAG: "decFlag",
    Flag.ENCODER_COMMAND: "encoderCommand",
    Flag.ENCODER_FEEDBACK: "encoderFeedback",
}
_REALS: Final = {
    Real.POS_CMD: "posCmd",
    Real.ACTUAL_POS: "actualPos",
    Real.VELOCITY_CMD: "velocityCmd",
    Real.ACTUAL_VELOCITY: "actualVelocity",
    Real.ACTUAL_TORQUE: "actualTorque",
    Real.PROFILE_TARGET_POS: "profileTargetPos",
    Real.PROFILE_REMAINING_MS: "profileRemainingMilliseconds",
    Real.CMD_ACC: "cmdAcc",
    Real.HOME_OFFSET: "homeOffset",
    Real.FOLLOWING_ERROR: "actualFollowingError",
}


class Translator:
    """Copies values of the port into the vendor's own objects; anything else passes untouched."""

    def __init__(self, module: ModuleType) -> None:
        self._module = module
        self._makers: dict[str, Callable[[], Any]] = {name: getattr(module, name) for name in COMMANDS}

    def __call__(self, value: Any) -> Any:
        name = type(value).__name__
        if isinstance(value, AxisSelection):
            return self._selection(value)
        if isinstance(value, Profile):
            return self._copy(value, self._module.Profile())
        if type(value).__module__.startswith("robot_stack.wmx.api") and name in self._makers:
            return self._copy(value, self._makers[name]())
        if isinstance(value, list):
            return [self(item) for item in value]
        return value

    def _selection(self, value: AxisSelection) -> Any:
        theirs = self._module.AxisSelection()
        theirs.axisCount = value.axisCount
        for index in range(value.axisCount):
            theirs.SetAxis(index, value.GetAxis(index))
        return theirs

    def _copy(self, value: Any, theirs: Any) -> Any:
        for item in fields(value):
            setattr(theirs, item.name, self(getattr(value, item.name)))
        return theirs


class Delegate:
    """An object of the vendor's library whose methods take the port's values."""

    def __init__(self, theirs: Any, translate: Translator) -> None:
        self.theirs = theirs
        self._translate = translate

    def __getattr__(self, name: str) -> Any:
        member = getattr(self.theirs, name)
        if not callable(member):
            return Delegate(member, self._translate)
        return lambda *arguments: member(*map(self._translate, arguments))


class EcatDelegate(Delegate):
    """The network; engine 3.5 has its Python call without the master that other versions want."""

    def ScanNetwork(self, masterId: int = 0) -> int:
        try:
            return cast(int, self.theirs.ScanNetwork(masterId))
        except TypeError:
            return cast(int, self.theirs.ScanNetwork())


def snapshot(
    status: Any, axes: Sequence[Any], inputs: Sequence[int], outputs: Sequence[int], stamp_ns: int
) -> StatusSnapshot:
    """The arrays of a vendor status, its axis records and its I/O bytes."""
    made = empty_snapshot(len(axes))
    for column, axis in enumerate(axes):
        for flag, name in _FLAGS.items():
            made.flags[flag, column] = int(getattr(axis, name))
        for real, name in _REALS.items():
            made.reals[real, column] = float(getattr(axis, name))
    cycle_ms = float(status.GetCycleTimeMilliseconds(0))
    cycles = int(status.GetCycleCounter(0))
    return StatusSnapshot(
        engine_state=EngineState(int(status.engineState)),
        epoch=0,
        cycle_counter=cycles,
        engine_time_s=1e-3 * cycles * cycle_ms,
        stamp_ns=stamp_ns,
        cycle_time_s=1e-3 * cycle_ms,
        engine_error=0,
        emergency_stop=bool(status.emergencyStop),
        emergency_stop_level=int(status.emergencyStopLevel),
        lost_cycles=0,
        overruns=0,
        reals=made.reals,
        flags=made.flags,
        inputs=np.array(inputs, np.uint8),
        outputs=np.array(outputs, np.uint8),
    )

"""A vendor status as arrays, and its age.

The vendor's status carries no time, but it counts cycles: while the bus communicates and the counter stands still, the
engine has stopped, and its last status is old.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from operator import attrgetter
from typing import Any, Final

import numpy as np

from robot_stack.wmx.api.enums import (
    AxisCommandMode,
    DetailOperationState,
    EngineState,
    EStopLevel,
    HomeError,
    HomeState,
    OperationState,
)
from robot_stack.wmx.api.values import MAX_AXES
from robot_stack.wmx.axes import UNTOLD, Flag, Real, StatusSnapshot, empty_snapshot
from robot_stack.wmx.vendor.records import Records

FLAGS: Final = {
    Flag.SERVO_ON: "servoOn",
    Flag.SERVO_REQUESTED: "servoOn",  # the vendor does not report requests
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
    Flag.POSITIVE_LS: "positiveLS",
    Flag.NEGATIVE_LS: "negativeLS",
    Flag.HOME_SWITCH: "homeSwitch",
    Flag.HOME_ERROR: "homeError",
}
REALS: Final = {
    Real.POS_CMD: "posCmd",
    Real.ACTUAL_POS: "actualPos",
    Real.VELOCITY_CMD: "velocityCmd",
    Real.ACTUAL_VELOCITY: "actualVelocity",
    Real.ACTUAL_TORQUE: "actualTorque",
    Real.PROFILE_TARGET_POS: "profileTargetPos",
    Real.PROFILE_REMAINING_MS: "profileRemainingMilliseconds",
    Real.CMD_ACC: "cmdAcc",
    Real.HOME_OFFSET: "homeOffset",
}
NEEDED: Final = ("servoOn", "servoOffline", "ampAlarm", "opState", "axisCommandMode", "posCmd", "actualPos")
"""Required fields of an axis; rows of other fields that a version lacks stay 0."""
_ENUMS: Final[dict[Flag, type[IntEnum]]] = {
    Flag.OP_STATE: OperationState,
    Flag.DETAIL_OP_STATE: DetailOperationState,
    Flag.COMMAND_MODE: AxisCommandMode,
    Flag.HOME_STATE: HomeState,
    Flag.HOME_ERROR: HomeError,
}


class Age:
    """Time of the engine's last cycle, and ``epoch``: number of detected restarts."""

    def __init__(self, stale_s: float) -> None:
        self.epoch = 0
        self._stale_ns = round(1e9 * stale_s)
        self._counter = -1
        self._seen_ns = 0

    def stamp(self, counter: int, communicating: bool, now_ns: int) -> int:
        """The monotonic time that a status with this cycle counter belongs to. The counter only runs with the bus."""
        if counter < self._counter:
            self.epoch += 1
        if counter != self._counter or not communicating:
            self._counter, self._seen_ns = counter, now_ns
        return self._seen_ns

    def stale(self, now_ns: int) -> bool:
        return now_ns - self._seen_ns > self._stale_ns


class SnapshotReader:
    """Makes snapshots of the first ``n_axes`` axes."""

    def __init__(self, records: Records) -> None:
        self._records = records
        self._rows: tuple[_Rows, _Rows] | None = None
        self._maps = {flag: records.enum(kind) for flag, kind in _ENUMS.items()}

    def read(
        self, status: Any, inputs: Sequence[int], outputs: Sequence[int], stamp_ns: int, epoch: int
    ) -> StatusSnapshot:
        """The arrays of a vendor status and its I/O bytes."""
        n_axes = min(self._records.n_axes, MAX_AXES)
        axes = [status.GetAxesStatus(axis) for axis in range(n_axes)]
        flags, reals = self._present(axes[0])
        made = empty_snapshot(n_axes)
        made.flags[flags.rows] = np.array([flags.of_axis(axis) for axis in axes], np.int64).T
        made.reals[reals.rows] = np.array([reals.of_axis(axis) for axis in axes], np.float64).T
        for flag, numbers in self._maps.items():
            made.flags[flag] = [numbers.ours(int(value)) for value in made.flags[flag]]
        # The vendor's own figure is in encoder counts, and only there if the drive was set up to send it.
        made.reals[Real.FOLLOWING_ERROR] = made.reals[Real.POS_CMD] - made.reals[Real.ACTUAL_POS]
        cycle_s = 1e-3 * float(status.GetCycleTimeMilliseconds(0))
        cycles = int(status.GetCycleCounter(0))
        return StatusSnapshot(
            engine_state=self.engine_state(status),
            epoch=epoch,
            cycle_counter=cycles,
            engine_time_s=cycles * cycle_s,
            stamp_ns=stamp_ns,
            cycle_time_s=cycle_s,
            engine_error=UNTOLD,
            emergency_stop=bool(status.emergencyStop),
            emergency_stop_level=self._records.enum(EStopLevel).ours(int(status.emergencyStopLevel)),
            lost_cycles=0,
            overruns=0,
            reals=made.reals,
            flags=made.flags,
            inputs=np.array(inputs, np.uint8),
            outputs=np.array(outputs, np.uint8),
        )

    def engine_state(self, status: Any) -> EngineState:
        """Unknown for a state that the port has no name for."""
        number = self._records.enum(EngineState).ours(int(status.engineState))
        return EngineState(number) if number in EngineState._value2member_map_ else EngineState.Unknown

    def _present(self, axis: Any) -> tuple[_Rows, _Rows]:
        if self._rows is None:
            self._rows = _Rows.of(FLAGS, axis), _Rows.of(REALS, axis)
        return self._rows


@dataclass(frozen=True, slots=True)
class _Rows:
    """Rows of a matrix with the fields of this library version, and the reader of those fields of an axis."""

    rows: list[int]
    of_axis: Callable[[Any], tuple[Any, ...]]

    @classmethod
    def of(cls, table: Mapping[Any, str], axis: Any) -> _Rows:
        present = {int(row): name for row, name in table.items() if hasattr(axis, name)}
        return cls(list(present), attrgetter(*present.values()))

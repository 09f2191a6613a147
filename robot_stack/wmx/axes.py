"""The engine's status as arrays: everything about all axes at one instant, without an object per axis.

A snapshot is two matrices, one row per quantity and one column per axis, and a few numbers about the engine. The
simulated engine publishes exactly this layout in shared memory; the vendor adapter fills it from status objects.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.api.enums import EngineState, OperationState

FloatRow = NDArray[np.float64]
IntRow = NDArray[np.int64]
BoolRow = NDArray[np.bool_]


class Real(IntEnum):
    """Rows of the float64 matrix; user units, seconds, milliseconds, percent of rated torque."""

    POS_CMD = 0
    ACTUAL_POS = 1
    VELOCITY_CMD = 2
    ACTUAL_VELOCITY = 3
    ACTUAL_TORQUE = 4
    PROFILE_TARGET_POS = 5
    PROFILE_REMAINING_MS = 6
    CMD_ACC = 7
    HOME_OFFSET = 8
    FOLLOWING_ERROR = 9


class Flag(IntEnum):
    """Rows of the int64 matrix: flags (0 or 1), codes and states by the vendor's numbers, encoder counts."""

    SERVO_ON = 0
    SERVO_REQUESTED = 1
    SERVO_OFFLINE = 2
    AMP_ALARM = 3
    AMP_ALARM_CODE = 4
    FOLLOWING_ERROR_ALARM = 5
    OP_STATE = 6
    DETAIL_OP_STATE = 7
    COMMAND_MODE = 8
    COMMAND_READY = 9
    MOTION_COMPLETE = 10
    IN_POS = 11
    CMD_DISTRIBUTION_END = 12
    POS_SET = 13
    DELAYED_POS_SET = 14
    POSITIVE_SOFT_LIMIT = 15
    NEGATIVE_SOFT_LIMIT = 16
    HOME_STATE = 17
    HOME_DONE = 18
    ACC_FLAG = 19
    DEC_FLAG = 20
    ENCODER_COMMAND = 21
    ENCODER_FEEDBACK = 22
    END_REASON = 23
    OWNER = 24
    POSITIVE_LS = 25
    NEGATIVE_LS = 26
    HOME_SWITCH = 27
    HOME_ERROR = 28


N_REALS = len(Real)
N_FLAGS = len(Flag)


UNTOLD = -1
"""``engine_error`` of an engine whose status lacks the cause of its lost communication."""


@dataclass(frozen=True, slots=True)
class StatusSnapshot:
    """The engine at one cycle. Arrays of length ``n_axes`` are views into one private copy and may be kept.

    ``epoch`` changes when the engine is stopped; devices do not outlive one. ``stamp_ns`` is the system's monotonic
    clock at publication, so that any process can compute the age; ``engine_time_s`` counts cycles and stands still with
    them.
    """

    engine_state: EngineState
    epoch: int
    cycle_counter: int
    engine_time_s: float
    stamp_ns: int
    cycle_time_s: float
    engine_error: int
    emergency_stop: bool
    emergency_stop_level: int
    lost_cycles: int
    overruns: int
    reals: NDArray[np.float64]
    flags: NDArray[np.int64]
    inputs: NDArray[np.uint8]
    outputs: NDArray[np.uint8]

    def age_s(self, now_ns: int) -> float:
        """Seconds since publication at ``now_ns`` of the monotonic clock; infinite for a snapshot never published."""
        return (now_ns - self.stamp_ns) * 1e-9 if self.stamp_ns else math.inf

    @property
    def n_axes(self) -> int:
        return int(self.reals.shape[1])

    @property
    def communicating(self) -> bool:
        return self.engine_state is EngineState.Communicating

    def held_at_zero(self, axis: int) -> bool:
        """Stopped by velocity 0, which is still a motion for the engine."""
        return bool(self.op_state[axis] == OperationState.Velocity and self.velocity_cmd[axis] == 0.0)

    def _real(self, row: Real) -> FloatRow:
        values: FloatRow = self.reals[row]
        return values

    def _code(self, row: Flag) -> IntRow:
        values: IntRow = self.flags[row]
        return values

    def _flag(self, row: Flag) -> BoolRow:
        return np.asarray(self.flags[row] != 0)

    @property
    def pos_cmd(self) -> FloatRow:
        """Commanded position, user units."""
        return self._real(Real.POS_CMD)

    @property
    def actual_pos(self) -> FloatRow:
        """Measured position, user units."""
        return self._real(Real.ACTUAL_POS)

    @property
    def velocity_cmd(self) -> FloatRow:
        """Commanded velocity, user units per second."""
        return self._real(Real.VELOCITY_CMD)

    @property
    def actual_velocity(self) -> FloatRow:
        """Measured velocity, user units per second."""
        return self._real(Real.ACTUAL_VELOCITY)

    @property
    def actual_torque(self) -> FloatRow:
        """Measured torque, percent of rated torque."""
        return self._real(Real.ACTUAL_TORQUE)

    @property
    def servo_on(self) -> BoolRow:
        """The drive reports on."""
        return self._flag(Flag.SERVO_ON)

    @property
    def servo_requested(self) -> BoolRow:
        """A client requested servo on; with ``servo_on`` false the drive is still switching, or has dropped out."""
        return self._flag(Flag.SERVO_REQUESTED)

    @property
    def amp_alarm(self) -> BoolRow:
        """The drive reports a fault."""
        return self._flag(Flag.AMP_ALARM)

    @property
    def amp_alarm_code(self) -> IntRow:
        """The drive's own fault number, 0 for none."""
        return self._code(Flag.AMP_ALARM_CODE)

    @property
    def following_error_alarm(self) -> BoolRow:
        """Feedback left the command by more than the configured width."""
        return self._flag(Flag.FOLLOWING_ERROR_ALARM)

    @property
    def op_state(self) -> IntRow:
        """OperationState numbers."""
        return self._code(Flag.OP_STATE)

    @property
    def command_mode(self) -> IntRow:
        """AxisCommandMode numbers."""
        return self._code(Flag.COMMAND_MODE)

    @property
    def motion_complete(self) -> BoolRow:
        """The last position motion ended normally."""
        return self._flag(Flag.MOTION_COMPLETE)

    @property
    def in_pos(self) -> BoolRow:
        """Feedback is within the in-position width of the current target."""
        return self._flag(Flag.IN_POS)

    @property
    def home_done(self) -> BoolRow:
        return self._flag(Flag.HOME_DONE)

    def input_bit(self, byte: int, bit: int) -> bool:
        """Digital input; False beyond the image: a missing input must look like an open contact."""
        return 0 <= byte < self.inputs.size and bool(self.inputs.item(byte) >> bit & 1)

    def output_bit(self, byte: int, bit: int) -> bool:
        """Digital output as commanded; False beyond the image."""
        return 0 <= byte < self.outputs.size and bool(self.outputs.item(byte) >> bit & 1)


class AxisFeedback(NamedTuple):
    """The drives' measurements at one cycle, for readers at several hundred Hz: a twentieth of a snapshot's cost, in
    plain numbers, because making arrays of a page costs more than reading it. One value per axis, user units.
    """

    communicating: bool
    epoch: int
    cycle_counter: int
    stamp_ns: int
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    outputs: bytes

    def output_bit(self, byte: int, bit: int) -> bool:
        """Digital output as commanded; False beyond the image."""
        return 0 <= byte < len(self.outputs) and bool(self.outputs[byte] >> bit & 1)


def axis_feedback(snapshot: StatusSnapshot) -> AxisFeedback:
    """The axis feedback of a snapshot."""
    return AxisFeedback(
        snapshot.communicating,
        snapshot.epoch,
        snapshot.cycle_counter,
        snapshot.stamp_ns,
        tuple(snapshot.actual_pos.tolist()),
        tuple(snapshot.actual_velocity.tolist()),
        snapshot.outputs.tobytes(),
    )


def empty_snapshot(n_axes: int = 0) -> StatusSnapshot:
    """The snapshot without an engine: state Unknown, age infinite, servos offline."""
    flags = np.zeros((N_FLAGS, n_axes), np.int64)
    flags[Flag.SERVO_OFFLINE] = 1
    return StatusSnapshot(
        engine_state=EngineState.Unknown,
        epoch=-1,
        cycle_counter=0,
        engine_time_s=0.0,
        stamp_ns=0,
        cycle_time_s=0.0,
        engine_error=0,
        emergency_stop=False,
        emergency_stop_level=0,
        lost_cycles=0,
        overruns=0,
        reals=np.zeros((N_REALS, n_axes)),
        flags=flags,
        inputs=np.zeros(0, np.uint8),
        outputs=np.zeros(0, np.uint8),
    )

"""The fieldbus port: the engine's exchange with its servo drives and I/O, once per cycle.

The engine owns both records and reuses them: a bus reads ``DriveCommands`` and fills ``DriveFeedback`` in place during
``exchange`` and keeps no reference to either. All values are in drive units (encoder counts); user units, polarity and
home offsets are handled by the engine.
"""

from __future__ import annotations

from typing import Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

MODE_POSITION: Final = 0
MODE_VELOCITY: Final = 1
MODE_TORQUE: Final = 2


class DriveCommands(NamedTuple):
    """Engine to drives; arrays of length ``n_axes``, except ``outputs``.

    ``position_counts`` and ``velocity_counts_per_s`` are both always valid. In position mode the velocity is
    feed-forward; in velocity mode the position follows the feedback. With the servo off the position follows the
    feedback and the velocity is zero. ``clear_alarm`` is held for several cycles by one request.
    """

    servo_on: NDArray[np.bool_]
    mode: NDArray[np.int8]
    position_counts: NDArray[np.int64]
    velocity_counts_per_s: NDArray[np.float64]
    clear_alarm: NDArray[np.bool_]
    outputs: NDArray[np.uint8]

    @classmethod
    def zeros(cls, n_axes: int, n_output_bytes: int) -> DriveCommands:
        """Everything off and at rest."""
        return cls(
            servo_on=np.zeros(n_axes, np.bool_),
            mode=np.zeros(n_axes, np.int8),
            position_counts=np.zeros(n_axes, np.int64),
            velocity_counts_per_s=np.zeros(n_axes, np.float64),
            clear_alarm=np.zeros(n_axes, np.bool_),
            outputs=np.zeros(n_output_bytes, np.uint8),
        )


class DriveFeedback(NamedTuple):
    """Drives to engine; arrays of length ``n_axes``, except ``inputs``. ``alarm_code`` 0 means no alarm.

    ``torque_percent`` is in percent of rated torque, positive in the drive's positive direction.
    """

    position_counts: NDArray[np.int64]
    velocity_counts_per_s: NDArray[np.float64]
    torque_percent: NDArray[np.float64]
    servo_on: NDArray[np.bool_]
    alarm_code: NDArray[np.int32]
    inputs: NDArray[np.uint8]

    @classmethod
    def zeros(cls, n_axes: int, n_input_bytes: int) -> DriveFeedback:
        """Servos off, no alarm, at position zero."""
        return cls(
            position_counts=np.zeros(n_axes, np.int64),
            velocity_counts_per_s=np.zeros(n_axes, np.float64),
            torque_percent=np.zeros(n_axes, np.float64),
            servo_on=np.zeros(n_axes, np.bool_),
            alarm_code=np.zeros(n_axes, np.int32),
            inputs=np.zeros(n_input_bytes, np.uint8),
        )


class ServoBus(Protocol):
    """The cyclic bus. ``exchange`` is called exactly once per engine cycle while the engine communicates.

    A last exchange with every servo off announces an orderly end of communication; no exchange follows until
    communication starts again. Each drive has its own bus watchdog.
    """

    n_axes: int

    def exchange(self, out: DriveCommands, inp: DriveFeedback) -> bool:
        """Sends ``out``, fills ``inp`` in place. Returns False if the bus was lost this cycle: ``inp`` is invalid."""
        ...

"""The engine's state: the arrays of the kernel and the few facts about the engine as a whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.api.enums import EngineState, EStopLevel
from robot_stack.wmx.axes import N_FLAGS, N_REALS, Flag
from robot_stack.wmx.engine_server.profile import MAX_SEGMENTS
from robot_stack.wmx.engine_server.rows import N_PARAMS, N_WORK

Reals = NDArray[np.float64]
Ints = NDArray[np.int64]


class EngineArrays(NamedTuple):
    """See the kernel for the layout. The arrays are made once and only ever written in place."""

    reals: Reals
    flags: Ints
    params: Reals
    work: Ints
    plan: Reals

    @classmethod
    def of(cls, n_axes: int) -> EngineArrays:
        arrays = cls(
            reals=np.zeros((N_REALS, n_axes)),
            flags=np.zeros((N_FLAGS, n_axes), np.int64),
            params=np.zeros((N_PARAMS, n_axes)),
            work=np.zeros((N_WORK, n_axes), np.int64),
            plan=np.zeros((n_axes, MAX_SEGMENTS, 4)),
        )
        arrays.clear()
        return arrays

    @property
    def n_axes(self) -> int:
        return int(self.flags.shape[1])

    def clear(self) -> None:
        """All axes idle, off and offline; parameters undefined."""
        for array in self:
            array.fill(0)
        self.flags[Flag.SERVO_OFFLINE] = 1
        self.flags[Flag.CMD_DISTRIBUTION_END] = 1


@dataclass(slots=True)
class Condition:
    """State of the whole engine.

    ``error`` is the code of the last unrequested end of communication. ``epoch`` changes whenever the
    engine is stopped: a device of an earlier epoch is void.
    """

    cycle_time_s: float
    state: EngineState = EngineState.Idle
    error: int = 0
    emergency_stop: bool = False
    emergency_stop_level: EStopLevel = EStopLevel.Level1
    cycles: int = 0
    epoch: int = 0
    lost_cycles: int = 0
    overruns: int = 0

    @property
    def communicating(self) -> bool:
        return self.state is EngineState.Communicating

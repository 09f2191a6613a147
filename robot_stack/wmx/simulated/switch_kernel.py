"""Limit and home switches of the drives, compiled: their states, and the effect of a limit on an axis that reaches it.

A limit acts on travel towards it, for as long as it is on; moving away is free. The switch named positive lies at the
positive end of travel, or with a reversed direction at the negative one.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.wmx.api.errors import ErrorCode
from robot_stack.wmx.axes import Flag
from robot_stack.wmx.simulated import rows
from robot_stack.wmx.simulated.kernel import (
    DETAIL_STOP,
    IDLE,
    LIMIT_DEC_SERVO_OFF,
    LIMIT_NONE,
    LIMIT_SERVO_OFF,
    LIMIT_SLOW_DEC,
    LIMIT_SLOW_DEC_SERVO_OFF,
    OP_STATE,
    SERVO_ON,
    SERVO_REQUESTED,
    STOP,
    VELOCITY_CMD,
    Ints,
    Reals,
    begin_stop,
)

POSITIVE_LS: Final = int(Flag.POSITIVE_LS)
NEGATIVE_LS: Final = int(Flag.NEGATIVE_LS)
HOME_SWITCH: Final = int(Flag.HOME_SWITCH)
REASON_HARD_LIMIT: Final = int(ErrorCode.AxisHardLimit)

IGNORE_POSITIVE_END: Final = 1
IGNORE_NEGATIVE_END: Final = 2
"""Bits of the work row LS_IGNORED: a homing motion uses that end's switch itself."""


@compiled
def _act(reals: Reals, flags: Ints, params: Reals, work: Ints, plan: Reals, i: int, kind: int) -> None:
    """The action of one limit on an axis that moves towards it."""
    if kind == LIMIT_SERVO_OFF:
        flags[SERVO_REQUESTED, i] = 0
    if kind in (LIMIT_DEC_SERVO_OFF, LIMIT_SLOW_DEC_SERVO_OFF):
        work[rows.SERVO_OFF_AT_REST, i] = 1
    if flags[OP_STATE, i] == STOP:  # under way already
        return
    slow = kind in (LIMIT_SLOW_DEC, LIMIT_SLOW_DEC_SERVO_OFF)
    dec = params[rows.LS_SLOW_DEC, i] if slow else params[rows.LS_DEC, i]
    begin_stop(reals, flags, work, plan, i, dec, DETAIL_STOP, REASON_HARD_LIMIT)


@compiled
def watch_switches(
    reals: Reals,
    flags: Ints,
    params: Reals,
    work: Ints,
    plan: Reals,
    positive_limit: NDArray[np.bool_],
    negative_limit: NDArray[np.bool_],
    home_switch: NDArray[np.bool_],
) -> None:
    """Reads one cycle's switches of every axis and applies the limits."""
    for i in range(flags.shape[1]):
        flags[POSITIVE_LS, i] = 1 if positive_limit[i] != (work[rows.LS_INVERT_POSITIVE, i] != 0) else 0
        flags[NEGATIVE_LS, i] = 1 if negative_limit[i] != (work[rows.LS_INVERT_NEGATIVE, i] != 0) else 0
        flags[HOME_SWITCH, i] = 1 if home_switch[i] != (work[rows.HS_INVERT, i] != 0) else 0
        if flags[SERVO_ON, i] == 0 or flags[OP_STATE, i] == IDLE:
            continue
        velocity = reals[VELOCITY_CMD, i]
        if velocity == 0.0:
            continue
        ignored = IGNORE_POSITIVE_END if velocity > 0.0 else IGNORE_NEGATIVE_END
        named_positive = (velocity > 0.0) == (work[rows.LS_REVERSED, i] == 0)
        on = flags[POSITIVE_LS, i] if named_positive else flags[NEGATIVE_LS, i]
        kind = work[rows.LS_POSITIVE_TYPE, i] if named_positive else work[rows.LS_NEGATIVE_TYPE, i]
        if on != 0 and kind != LIMIT_NONE and work[rows.LS_IGNORED, i] & ignored == 0:
            _act(reals, flags, params, work, plan, i, kind)

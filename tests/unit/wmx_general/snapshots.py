"""Status snapshots of axes at rest with servos on, for decisions based on one status."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from robot_stack.wmx.api import EngineState
from robot_stack.wmx.axes import Flag, StatusSnapshot, empty_snapshot


def standing(n_axes: int = 4, **fields: Any) -> StatusSnapshot:
    """Returns a status: communicating, every servo on, position mode, idle, at zero."""
    snapshot = replace(empty_snapshot(n_axes), **{"engine_state": EngineState.Communicating, **fields})
    snapshot.flags[Flag.SERVO_ON] = 1
    snapshot.flags[Flag.SERVO_OFFLINE] = 0
    return snapshot


def with_flag(flag: Flag, axis: int, value: int, **fields: Any) -> StatusSnapshot:
    snapshot = standing(**fields)
    snapshot.flags[flag, axis] = value
    return snapshot

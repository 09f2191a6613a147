"""The engine's status as the arrays of ``/wmx/axis/state``."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from typing import Final, TypeAlias

from robot_stack.wmx.axes import Flag, Real, StatusSnapshot

Column: TypeAlias = "array[int] | array[float]"

_FLAGS: Final = {
    "amp_alarm": Flag.AMP_ALARM,
    "servo_on": Flag.SERVO_ON,
    "home_done": Flag.HOME_DONE,
    "in_pos": Flag.IN_POS,
    "negative_ls": Flag.NEGATIVE_LS,
    "positive_ls": Flag.POSITIVE_LS,
    "home_switch": Flag.HOME_SWITCH,
}
_REALS: Final = {
    "pos_cmd": Real.POS_CMD,
    "velocity_cmd": Real.VELOCITY_CMD,
    "actual_pos": Real.ACTUAL_POS,
    "actual_velocity": Real.ACTUAL_VELOCITY,
}


def axis_state(snapshot: StatusSnapshot, axis_count: int, rated_torque_nm: Sequence[float]) -> dict[str, Column]:
    """The fields of the message, each with ``axis_count`` entries; flags 0 or 1, user units.

    rated_torque_nm: per axis; the engine reports percent of it.
    """
    fields: dict[str, Column] = {}
    for name, flag in _FLAGS.items():
        fields[name] = array("i", (snapshot.flags[flag, :axis_count] != 0).tolist())
    for name, real in _REALS.items():
        fields[name] = array("d", snapshot.reals[real, :axis_count].tolist())
    percent = snapshot.actual_torque[:axis_count].tolist()
    torque = [0.01 * share * rated for share, rated in zip(percent, rated_torque_nm, strict=True)]
    fields["actual_torque"] = array("d", torque)
    return fields

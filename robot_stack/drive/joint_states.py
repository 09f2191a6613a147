"""The arrays of a joint state message, checked and sorted by joint."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robot_stack.contract.frames import DRIVE_AXES, JOINTS, STEER_AXES
from robot_stack.drive.kinematics import Four
from robot_stack.drive.odometry import Encoders

_KNOWN = frozenset(JOINTS)


class BadJointStates(ValueError):
    """A joint state message that must not be used. The message names the field and its limit."""


def encoders(
    stamp_s: float, names: Sequence[str], positions_rad: Sequence[float], received_s: float | None = None
) -> Encoders:
    """The readings of the eight joints, in whatever order ``names`` has them. Raises BadJointStates."""
    if len(names) != len(JOINTS) or frozenset(names) != _KNOWN:
        raise BadJointStates(
            f"name must be the {len(JOINTS)} joints {', '.join(JOINTS)}, is {', '.join(names) or 'empty'}"
        )
    if len(positions_rad) != len(JOINTS):
        raise BadJointStates(f"position must have {len(JOINTS)} values, has {len(positions_rad)}")
    by_name = dict(zip(names, positions_rad, strict=True))
    for name, value in by_name.items():
        if not math.isfinite(value):
            raise BadJointStates(f"position of {name} must be finite, is {value}")
    values = [float(by_name[name]) for name in JOINTS]
    return Encoders(stamp_s, _pick(values, DRIVE_AXES), _pick(values, STEER_AXES), received_s)


def _pick(values: Sequence[float], axes: tuple[int, int, int, int]) -> Four:
    a, b, c, d = axes
    return values[a], values[b], values[c], values[d]

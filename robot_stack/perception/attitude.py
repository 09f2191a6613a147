"""Roll and pitch from an orientation."""

from __future__ import annotations

from robot_stack.core.geometry import tilt_from_quaternion
from robot_stack.perception.deskew import Attitude

_UNIT_TOLERANCE = 0.01


def attitude_of(x: float, y: float, z: float, w: float) -> Attitude | None:
    """Roll and pitch of a quaternion, base_link to an upright frame; None if it is not a unit quaternion.

    A sensor without orientation sends zeros, a broken one NaN.
    """
    norm2 = x * x + y * y + z * z + w * w
    if not abs(norm2 - 1.0) < _UNIT_TOLERANCE:
        return None
    return Attitude(*tilt_from_quaternion(x, y, z, w))

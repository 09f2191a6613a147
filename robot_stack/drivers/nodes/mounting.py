"""A sensor's mounting, published by its driver on /tf_static."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray

from robot_stack.contract import frames
from robot_stack.core.robot_shape import quaternion_of


def mounting(
    frame: str, xyz_m: tuple[float, float, float], rotation: NDArray[np.float64], stamp: Time
) -> TransformStamped:
    """rotation: (3, 3) from the sensor's frame to base_link."""
    transform = TransformStamped(child_frame_id=frame)
    transform.header.frame_id, transform.header.stamp = frames.BASE_LINK, stamp
    place, turned = transform.transform.translation, transform.transform.rotation
    place.x, place.y, place.z = xyz_m
    turned.x, turned.y, turned.z, turned.w = quaternion_of(rotation)
    return transform

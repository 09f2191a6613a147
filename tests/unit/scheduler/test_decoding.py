"""Decoded messages equal those of the middleware, for every type of the contract."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from robot_stack.middleware.interfaces import interface_class
from sim.scheduler.decoding import _message, decoder
from tests.unit.ros.test_serialization import TYPES, filled


def alike(one: Any, other: Any) -> bool:
    """Returns whether two values are equal, including all types inside."""
    if type(one) is not type(other):
        return False
    if hasattr(one, "get_fields_and_field_types"):
        return all(alike(getattr(one, name), getattr(other, name)) for name in one.__slots__)
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.flags.writeable and bool(np.array_equal(one, other, equal_nan=True))
    if isinstance(one, list):
        return len(one) == len(other) and all(alike(*pair) for pair in zip(one, other, strict=True))
    return bool(one == other) or one != one


@pytest.mark.parametrize("type_name", TYPES)
def test_a_message_is_that_of_the_middleware(type_name: str) -> None:
    _message(type_name)  # decoded from the bytes, without a fallback to the middleware
    for length in (0, 1, 2, 5):
        message = filled(interface_class(type_name)(), length)
        data = bytes(serialize_message(message))
        assert alike(decoder(type_name)(data), deserialize_message(data, type(message))), length


def test_decoding_truncated_message_raises() -> None:
    data = bytes(serialize_message(interface_class("nav_msgs/msg/Odometry")()))
    with pytest.raises(Exception, match=r"\w"):
        decoder("nav_msgs/msg/Odometry")(data[:40])

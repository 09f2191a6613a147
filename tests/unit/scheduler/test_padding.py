"""Padding of serialised messages, of every type of the contract."""

from __future__ import annotations

from typing import Any

import pytest
from rclpy.serialization import deserialize_message, serialize_message

from robot_stack.contract import topics
from robot_stack.middleware.interfaces import interface_class
from sim.scheduler.padding import UnknownLayout, zero_padding

TYPES = sorted({row.type for row in topics.TOPICS})


def filled(message: Any, length: int) -> Any:
    """Strings and sequences of odd lengths in every field, so that what follows them is badly aligned."""
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if kind.startswith("string"):
            setattr(message, name, "a" * length)
        elif hasattr(value, "get_fields_and_field_types"):
            filled(value, length + 1)
        elif kind.startswith("sequence<"):
            inner = kind.removeprefix("sequence<").split(",")[0].rstrip(">")
            if "/" in inner:
                package, item = inner.split("/")
                setattr(
                    message,
                    name,
                    [filled(interface_class(f"{package}/msg/{item}")(), length + k) for k in range(length)],
                )
            elif inner.startswith("string"):
                setattr(message, name, ["b" * (length + k) for k in range(length)])
            elif inner in ("float", "double"):
                setattr(message, name, [1.0] * length)
            elif inner == "boolean":
                setattr(message, name, [True] * length)
            else:
                setattr(message, name, [1] * length)
    return message


@pytest.mark.parametrize("length", [0, 1, 2, 5])
@pytest.mark.parametrize("type_name", TYPES)
def test_only_padding_changes_and_all_of_it(type_name: str, length: int) -> None:
    message = filled(interface_class(type_name)(), length)
    clean = zero_padding(type_name)(bytes(serialize_message(message)))
    assert deserialize_message(clean, type(message)) == message
    # Memory that was used for other things shows in what the middleware leaves.
    for rubbish in (b"\xaa", b"\x55"):
        kept = [rubbish * len(clean) for _ in range(20)]
        del kept
        assert zero_padding(type_name)(bytes(serialize_message(message))) == clean


def test_padding_that_is_not_zero_is_set_to_zero() -> None:
    """A stamp (8 bytes), "aa" (4 + 3, one of padding), a sequence of texts without items (4), one double (4 + 8)."""
    message = interface_class("sensor_msgs/msg/JointState")(position=[1.5])
    message.header.frame_id = "aa"
    clean = zero_padding("sensor_msgs/msg/JointState")(bytes(serialize_message(message)))
    assert clean[4 + 15] == 0
    spoilt = bytearray(clean)
    spoilt[4 + 15] = 0x77
    assert zero_padding("sensor_msgs/msg/JointState")(bytes(spoilt)) == clean


def test_bytes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(UnknownLayout):
        zero_padding("std_msgs/msg/Int32")(bytes(7))
    with pytest.raises(UnknownLayout):
        zero_padding("std_msgs/msg/String")(bytes(4))

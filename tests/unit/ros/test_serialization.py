"""Serialised messages of every type of the contract are reproducible byte by byte."""

from __future__ import annotations

from typing import Any

import pytest

from robot_stack.contract import topics
from robot_stack.middleware.interfaces import interface_class
from robot_stack.ros.serialization import deserialize_message, serialize_message

TYPES = sorted({row.type for row in topics.TOPICS})


def filled(message: Any, length: int) -> Any:
    """Fills every field with strings and sequences of odd lengths, to misalign the following fields."""
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


@pytest.mark.parametrize("type_name", TYPES)
def test_the_same_message_has_the_same_bytes(type_name: str) -> None:
    for length in (0, 1, 2, 5):
        message = filled(interface_class(type_name)(), length)
        data = serialize_message(message)
        assert deserialize_message(data, type(message)) == message
        # An allocator returns recently freed memory, whose content would show in the bytes.
        for rubbish in (b"\xaa", b"\x55"):
            kept = [rubbish * len(data) for _ in range(20)]
            del kept
            assert serialize_message(filled(interface_class(type_name)(), length)) == data


def test_padding_is_zero() -> None:
    """A stamp (8 bytes), "aa" (4 + 3, one of padding), a sequence of texts without items (4), one double (4 + 8)."""
    message = interface_class("sensor_msgs/msg/JointState")(position=[1.5])
    message.header.frame_id = "aa"
    assert serialize_message(message)[4 + 15] == 0


def test_a_message_larger_than_the_buffer_is_serialised_whole() -> None:
    message = interface_class("std_msgs/msg/String")(data="x" * 3_000_000)
    assert deserialize_message(serialize_message(message), type(message)) == message
    assert serialize_message(message) == serialize_message(message)


def test_what_is_no_message_is_refused() -> None:
    with pytest.raises(TypeError):
        serialize_message("text")

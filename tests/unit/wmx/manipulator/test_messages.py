"""The bytes equal those of the middleware's own serialisation."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from robot_stack.wmx.manipulator.messages import ArrayBytes, JointStateBytes

NAMES = ["joint1", "joint2", "joint3", "joint4", "joint5", "joint6", "picker_1_joint", "picker_2_joint"]


def _written(ours: bytes, theirs: bytes) -> bool:
    """Equal except for padding, which the middleware does not write, and unused space at its end."""
    return len(ours) <= len(theirs) and all(a == b for a, b in zip(ours, theirs, strict=False) if a)


def test_a_joint_state_by_hand():
    message = JointStateBytes(["ab"])
    message.put([1.0], [-2.0])
    assert message.stamped(3_000_000_004).hex(" ", 4) == " ".join(
        [
            "00010000",  # CDR, little endian
            "03000000 04000000",  # stamp
            "01000000 00000000",  # frame_id: one byte, the zero; padding
            "01000000 03000000 61620000",  # one name of 3 bytes, a b 0; padding
            "01000000 00000000 0000f03f",  # one position, aligned to 8 after the first four bytes
            "01000000 00000000 00000000 000000c0",  # one velocity; padding before it
            "00000000",  # no effort
        ]
    )


@given(
    names=st.lists(st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=12), max_size=10),
    data=st.data(),
    stamp_ns=st.integers(0, 2**31 * 10**9 - 1),
)
def test_any_joint_state(names: list[str], data: st.DataObject, stamp_ns: int):
    values = st.lists(st.floats(allow_nan=False), min_size=len(names), max_size=len(names))
    position, velocity = data.draw(values), data.draw(values)
    ours = JointStateBytes(names)
    ours.put(position, velocity)
    theirs = JointState(name=names, position=position, velocity=velocity)
    theirs.header.stamp.sec, theirs.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    assert deserialize_message(ours.stamped(stamp_ns), JointState) == theirs
    assert _written(ours.stamped(stamp_ns), serialize_message(theirs))


@given(st.lists(st.floats(allow_nan=False), max_size=20))
def test_any_array(values: list[float]):
    ours = ArrayBytes(len(values))
    theirs = Float64MultiArray(data=values)
    assert deserialize_message(ours.filled(values), Float64MultiArray) == theirs
    assert _written(ours.filled(values), serialize_message(theirs))


def test_values_change_from_one_message_to_the_next_and_sent_ones_do_not():
    message = JointStateBytes(NAMES)
    message.put(range(8), [0.0] * 8)
    first = message.stamped(1)
    message.put([0.5] * 8, [0.0] * 8)
    second = message.stamped(2)
    assert list(deserialize_message(first, JointState).position) == [float(value) for value in range(8)]
    assert deserialize_message(second, JointState).position[0] == 0.5
    assert deserialize_message(second, JointState).header.stamp.nanosec == 2
    assert list(deserialize_message(second, JointState).effort) == []


@pytest.mark.parametrize("count", [0, 7, 9])
def test_another_number_of_values_is_refused(count: int):
    with pytest.raises(struct.error):
        JointStateBytes(NAMES).put([0.0] * count, [0.0] * 8)
    with pytest.raises(struct.error):
        ArrayBytes(8).filled([0.0] * count)

"""The messages of one tick and their order."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from robot_stack.core.config import load
from robot_stack.wmx.axes import AxisFeedback, Real, axis_feedback, empty_snapshot
from robot_stack.wmx.manipulator.params import ManipulatorStateParams
from robot_stack.wmx.nodes.joint_outputs import JointOutputs
from robot_stack.wmx.nodes.manipulator_state import ManipulatorStateNode

NAMES = ("joint1", "left", "right")
PARAMS = load(ManipulatorStateParams, "manipulator_state").model_copy(update={"joint_number": 1, "joint_name": NAMES})
STAMP_NS = 5_000_000_006


class Sent:
    """Three senders that record their messages."""

    def __init__(self) -> None:
        self.items: list[tuple[str, bytes]] = []

    def sender(self, name: str, *, received: bool = True) -> Any:
        return SimpleNamespace(send=lambda data: self.items.append((name, data)), has_subscribers=received)


def node(sent: Sent, *, without: tuple[str, ...] = (), unheard: tuple[str, ...] = (), isaac_stamp: bool = False) -> Any:
    """Returns the parts of the node that a tick needs."""
    senders = (
        None if name in without else sent.sender(name, received=name not in unheard)
        for name in ("encoder", "isaac", "gazebo")
    )
    return SimpleNamespace(
        params=PARAMS,
        _outputs=JointOutputs(NAMES, *senders, isaac_stamp=isaac_stamp),
        now_ns=lambda: STAMP_NS,
    )


def feedback(position: float = 0.5) -> AxisFeedback:
    snapshot = replace(empty_snapshot(1), outputs=np.array([1], np.uint8))
    snapshot.reals[Real.ACTUAL_POS, 0] = position
    snapshot.reals[Real.ACTUAL_VELOCITY, 0] = -1.0
    return axis_feedback(snapshot)


def test_isaac_without_stamp_then_the_stamped_one_then_gazebo():
    sent = Sent()
    assert not ManipulatorStateNode._publish(node(sent), feedback())
    assert [name for name, _ in sent.items] == ["isaac", "encoder", "gazebo"]
    isaac, encoder = (deserialize_message(data, JointState) for _, data in sent.items[:2])
    assert (isaac.header.stamp.sec, isaac.header.stamp.nanosec) == (0, 0)
    assert (encoder.header.stamp.sec, encoder.header.stamp.nanosec) == (5, 6)
    assert list(isaac.position) == list(encoder.position) == [0.5, 0.045, 0.045]
    assert list(isaac.velocity) == list(encoder.velocity) == [-1.0, 0.0, 0.0]
    gazebo = deserialize_message(sent.items[2][1], Float64MultiArray)
    assert list(gazebo.data) == [0.5, 0.045, 0.045]


def test_a_stamp_for_isaac_if_so_configured():
    sent = Sent()
    assert not ManipulatorStateNode._publish(node(sent, isaac_stamp=True), feedback())
    assert deserialize_message(sent.items[0][1], JointState).header.stamp.sec == 5


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"without": ("isaac", "gazebo")}, ["encoder"]),
        ({"without": ("encoder", "isaac")}, ["gazebo"]),
        ({"unheard": ("isaac", "gazebo")}, ["encoder"]),
    ],
)
def test_unset_or_unsubscribed_outputs_are_not_published(changes: dict[str, Any], names: list[str]):
    sent = Sent()
    assert not ManipulatorStateNode._publish(node(sent, **changes), feedback())
    assert [name for name, _ in sent.items] == names


def test_a_value_that_is_not_finite_is_not_sent():
    sent = Sent()
    problem = ManipulatorStateNode._publish(node(sent), feedback(math.nan))
    assert (problem, sent.items) == ("a joint's position or velocity is not finite", [])

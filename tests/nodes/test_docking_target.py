"""/docking/target: the dock's pose relative to the robot, only on the final approach."""

from __future__ import annotations

import math
from typing import Any

import pytest
from builtin_interfaces.msg import Time

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.contract.states import DockingState
from robot_stack.core.config import load
from robot_stack.core.geometry import Pose2
from robot_stack.docking.nodes.outputs import DockingOutputs
from robot_stack.docking.params import DockingParams
from robot_stack.docking.target import Estimate
from robot_stack.middleware.conversions import pose_from_msg


class FakeNode:
    """Records published messages by topic."""

    def __init__(self) -> None:
        self.published: dict[str, list[Any]] = {}

    def advertise(self, row: Topic) -> Any:
        messages = self.published.setdefault(row.name, [])
        return type("Publisher", (), {"publish": staticmethod(messages.append)})

    def emergency_stop_source(self, *, until_latched: bool) -> None:
        """Not needed here."""

    def stamp(self) -> Time:
        return Time(sec=7)


# In odom the dock is 2 m ahead of a robot that faces along y.
BASE, DOCK = Pose2(1.0, 1.0, 0.5 * math.pi), Estimate(Pose2(1.0, 3.0, 0.5 * math.pi), 0.01, 0.01)


@pytest.mark.parametrize("state", list(DockingState))
def test_only_while_the_robot_moves_into_the_dock(state: DockingState) -> None:
    node: Any = FakeNode()
    navigation: Any = None  # no goal is sent here
    outputs = DockingOutputs(node, load(DockingParams, "docking_controller"), navigation)
    outputs.target(state, DOCK, BASE)
    outputs.target(state, None, BASE)
    outputs.target(state, DOCK, None)
    sent = node.published[topics.DOCKING_TARGET.name]
    assert len(sent) == (1 if state in (DockingState.SERVOING, DockingState.FINE_ALIGN) else 0)
    for message in sent:
        pose = pose_from_msg(message.pose)
        assert (pose.x, pose.y, pose.yaw) == pytest.approx((2.0, 0.0, 0.0), abs=1e-9)
        assert (message.header.frame_id, message.header.stamp.sec) == ("base_link", 7)

"""A second participant of a process ends in order; if it cannot end, nothing crashes."""

from __future__ import annotations

import threading

import pytest
from std_msgs.msg import Bool

from robot_stack.contract import topics
from robot_stack.ros import tool_node
from robot_stack.ros.interfaces import interface_class, qos_profile
from robot_stack.ros.tool_node import ToolNode
from tests.support.peer import Peer
from tests.support.waiting import wait_for

ROW = topics.EMERGENCY_STOP


def test_node_used_by_running_thread_is_not_destroyed(
    ros_domain: int, peer: Peer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tool_node, "_JOIN_S", 0.2)
    taken, resume = threading.Event(), threading.Event()

    def hold(_: Bool) -> None:
        taken.set()
        resume.wait(60.0)

    held = ToolNode("held_up")
    subscription = held.node.create_subscription(interface_class(ROW.type), ROW.name, hold, qos_profile(ROW.qos))
    held.spin_beside("held_up")
    peer.wait_matched(ROW)
    peer.publish(ROW, Bool(data=True))
    wait_for(taken.is_set, "the callback")
    try:
        held.close()
        with subscription.handle:  # raises InvalidHandle after destruction
            pass
    finally:
        resume.set()
    wait_for(lambda: "held_up" not in [thread.name for thread in threading.enumerate()], "the thread's end")
    held.close()
    assert not held.executor.context.ok()


def test_a_thread_that_has_only_just_begun_ends_too(ros_domain: int) -> None:
    for _ in range(20):
        brief = ToolNode("brief")
        brief.spin_beside("brief")
        brief.close()
        assert not brief.executor.context.ok()
        assert "brief" not in [thread.name for thread in threading.enumerate()]

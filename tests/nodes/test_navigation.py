"""The navigation controller as a process: start and end. How it drives: tests/simulated/nodes."""

from __future__ import annotations

import signal
from collections.abc import Callable

from geometry_msgs.msg import Twist

from robot_stack.contract import topics
from tests.support.blind import BLIND
from tests.support.peer import Peer
from tests.support.processes import NodeProcess


def test_it_stands_with_an_empty_plan_and_leaves_in_order(start: Callable[..., NodeProcess], peer: Peer) -> None:
    node = start("navigation_controller", *BLIND)
    commands = peer.listen(topics.CMD_VEL)
    commands.wait(lambda message: message == Twist(), "a zero command")
    late = peer.listen(topics.PLAN)  # kept for who comes later
    assert late.wait(lambda message: not message.poses, "the empty plan").header.frame_id == "map"
    node.signal(signal.SIGTERM)
    assert node.wait() == 0
    assert all(message == Twist() for message in commands.messages)

"""The node ``supervisor``: hears the heartbeats of all processes."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.type_support import check_for_type_support

from custom_msgs.msg import Heartbeat
from robot_stack.contract import topics
from robot_stack.ros.interfaces import interface_class
from robot_stack.ros.node import StackNode
from robot_stack.ros.process import ros_process
from robot_stack.supervisor.ears import Beat


class SupervisorNode(StackNode):
    def __init__(self, tell: Callable[[Beat], None]) -> None:
        super().__init__("supervisor")
        self._tell = tell
        self.subscribe(topics.HEARTBEAT, self._on_heartbeat)
        self.set_health(True, "supervising")

    def _on_heartbeat(self, message: Heartbeat) -> None:
        self._tell(Beat(self.steady_s(), message.node, message.pid, message.ready, message.waiting_for))


def listen(tell: Callable[[Beat], None], should_stop: Callable[[], bool]) -> None:
    """Runs the node until ``should_stop``."""
    with ros_process(lambda: SupervisorNode(tell)) as (executor, _):
        executor.spin(should_stop)


def load_type_supports() -> None:
    """Loads the C libraries of all message types of the contract, which rclpy else does at each first use."""
    for row in topics.TOPICS:
        check_for_type_support(interface_class(row.type))

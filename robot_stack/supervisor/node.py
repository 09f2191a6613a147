"""The node ``supervisor``: hears the heartbeats of all processes, and holds the operator's keys of the emergency stop.

A new node needs 0.1 to 2.5 s until everybody has discovered it, too long for ``robot-stack estop``. This one is known.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.type_support import check_for_type_support
from std_msgs.msg import Bool

from custom_msgs.msg import Heartbeat
from robot_stack.contract import services, topics
from robot_stack.ros.interfaces import interface_class
from robot_stack.ros.node import StackNode
from robot_stack.ros.process import ros_process
from robot_stack.supervisor.ears import Beat, Safety

_LET_GO_RATE_HZ = 5.0


class SupervisorNode(StackNode):
    def __init__(self, tell: Callable[[Beat], None]) -> None:
        super().__init__("supervisor")
        self._tell = tell
        self._stop = self.advertise(topics.EMERGENCY_STOP)
        self._reset = self.create_client(interface_class(services.SAFETY_RESET.type), services.SAFETY_RESET.name)
        self._holding = self._in_force = False
        self.subscribe(topics.HEARTBEAT, self._on_heartbeat)
        self.every(_LET_GO_RATE_HZ, self._let_go)
        self.set_health(True, "supervising")

    def _on_heartbeat(self, message: Heartbeat) -> None:
        # The plain clock of the supervisor's loop: the node's own stands still while this process is held up.
        self._tell(Beat(time.monotonic(), message.node, message.pid, message.ready, message.waiting_for))

    # --- what the supervisor's other thread asks for -----------------------------------------------------------------

    def publish_stop(self, active: bool) -> int:
        """Returns how many listen."""
        self._holding, self._in_force = active, self.emergency_stop
        self._stop.publish(Bool(data=active))
        return int(self._stop.get_subscription_count())

    def ask_reset(self) -> Any:
        """A future of the safety monitor's response; None if it serves no reset."""
        if not self._reset.service_is_ready():
            return None
        return self._reset.call_async(interface_class(services.SAFETY_RESET.type).Request())

    def safety(self) -> Safety | None:
        """What the safety monitor said last; None if it has said nothing yet."""
        heard = self.safety_status_input
        if heard.latest is None:
            return None
        return Safety(
            state=heard.latest.safety_state,
            emergency=heard.latest.emergency_stop_active,
            faults=tuple(heard.latest.active_faults),
            age_s=heard.age_s(),
            received=heard.received,
        )

    # --- the latched value ------------------------------------------------------------------------------------------

    def on_emergency_stop(self) -> None:
        self._in_force = True

    def _let_go(self) -> None:
        """After a stop that somebody else has released: a node that starts later must not find our old ``true``."""
        if self._holding and self._in_force and not self.emergency_stop:
            self.publish_stop(False)


def listen(tell: Callable[[Beat], None], made: Callable[[SupervisorNode], None], stop: Callable[[], bool]) -> None:
    """Runs the node until ``stop``; hands it to ``made`` first."""
    with ros_process(lambda: SupervisorNode(tell)) as (executor, nodes):
        made(nodes[0])
        executor.spin(stop)


def load_type_supports() -> None:
    """Loads the C libraries of all message types of the contract, which rclpy else does at each first use."""
    for row in topics.TOPICS:
        check_for_type_support(interface_class(row.type))

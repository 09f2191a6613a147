"""The node ``supervisor``: holds the operator's keys of the emergency stop and subscribes to the safety status.

Discovery of a new node takes 0.1 to 2.5 s, too long for ``robot-stack estop``. This node is already discovered.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.type_support import check_for_type_support

from robot_stack.contract import services, topics
from robot_stack.contract.model import SafetyState
from robot_stack.middleware.interfaces import interface_class
from robot_stack.middleware.node import StackNode
from robot_stack.ros.process import ros_process
from robot_stack.supervisor.safety_view import Safety

_RELEASE_RATE_HZ = 5.0


class ResetAnswer:
    """response: None until it has arrived."""

    def __init__(self) -> None:
        self.response: Any = None

    def set(self, response: Any) -> None:
        self.response = response


class SupervisorNode(StackNode):
    def __init__(self) -> None:
        super().__init__("supervisor")
        self._stop = self.emergency_stop_source()
        self._reset = self.client(services.SAFETY_RESET)
        self._holding = self._in_force = False
        self.every(_RELEASE_RATE_HZ, self._release)
        self.set_health(True, "supervising")

    # --- called by the supervisor's other thread ---------------------------------------------------------------------

    def publish_stop(self, active: bool) -> int:
        """Returns how many listen."""
        self._holding, self._in_force = active, self.emergency_stop
        self._stop.publish(active)
        return self._stop.listeners

    def ask_reset(self) -> ResetAnswer | None:
        """The safety monitor's answer once it has arrived; None if it offers no reset."""
        if not self._reset.service_is_ready():
            return None
        answer = ResetAnswer()
        self._reset.call(interface_class(services.SAFETY_RESET.type).Request(), answer.set)
        return answer

    def safety(self) -> Safety | None:
        """The last state from the safety monitor; None before the first."""
        status = self.safety_status_input
        if status.latest is None:
            return None
        return Safety(
            state=status.latest.safety_state,
            emergency=status.latest.safety_state == SafetyState.EMERGENCY_STOP.name,
            faults=tuple(status.latest.active_faults),
            age_s=status.age_s(),
            received=status.received,
        )

    # --- the latched value ------------------------------------------------------------------------------------------

    def on_emergency_stop(self) -> None:
        self._in_force = True

    def _release(self) -> None:
        """Publishes false after another source's release: a node that starts later must not get our old ``true``."""
        if self._holding and self._in_force and not self.emergency_stop:
            self.publish_stop(False)


def run(made: Callable[[SupervisorNode, Callable[[], None]], None], stop: Callable[[], bool]) -> None:
    """Runs the node until ``stop`` returns True; first passes it to ``made``, with a function that wakes the loop."""
    with ros_process(SupervisorNode) as (executor, nodes):
        made(nodes[0], executor.wake)
        executor.spin(stop)


def load_type_supports() -> None:
    """Loads the C libraries of all message types of the contract, which rclpy else does at each first use."""
    for row in topics.TOPICS:
        check_for_type_support(interface_class(row.type))

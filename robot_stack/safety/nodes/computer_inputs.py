"""Inputs of the safety monitor from the robot's computer and the links to displays and screens."""

from __future__ import annotations

from collections.abc import Callable

from sensor_msgs.msg import Temperature
from std_msgs.msg import Header

from custom_msgs.msg import EHMIStatus, RobotStatus
from robot_stack.contract import topics
from robot_stack.middleware.node import StackNode
from robot_stack.safety.observation import Observation


class ComputerInputs:
    """Subscriptions of the node ``safety_monitor``.

    observation: returns the present one, which a start under /clock replaces.
    """

    def __init__(self, node: StackNode, observation: Callable[[], Observation]) -> None:
        self._observation = observation
        self._status = node.subscribe(topics.ROBOT_STATUS, self._on_status)
        self._temperature = node.subscribe(topics.COMPUTER_TEMPERATURE, self._on_temperature)
        self._ehmi = node.subscribe(topics.EHMI_STATUS, self._on_ehmi)
        self._ui = node.subscribe(topics.UI_HEARTBEAT, self._on_ui)

    def _on_status(self, message: RobotStatus) -> None:
        cpu, memory, disk = message.cpu_usage_percent, message.memory_usage_percent, message.disk_usage_percent
        self._observation().computer.usage(cpu, memory, disk, self._status.received_s)

    def _on_temperature(self, message: Temperature) -> None:
        self._observation().computer.temperature(message.temperature, self._temperature.received_s)

    def _on_ehmi(self, message: EHMIStatus) -> None:
        self._observation().ehmi.status(message.linked, self._ehmi.received_s)

    def _on_ui(self, _: Header) -> None:
        self._observation().ui.alive(self._ui.received_s)

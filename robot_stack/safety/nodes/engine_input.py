"""Input of the safety monitor from the motion engine: its status in shared memory, read in a thread of its own."""

from __future__ import annotations

from robot_stack.middleware.node import StackNode
from robot_stack.safety.button import read_contact
from robot_stack.safety.inputs import DriveReading, drive_reading
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.view import EngineView


class EngineInput:
    """reading: the newest, None without a status. The thread assigns it atomically; a step reads it."""

    def __init__(self, node: StackNode, rate_hz: float) -> None:
        self._robot = node.robot
        self.reading: DriveReading | None = None
        self._view = node.device(EngineView, node.get_name(), rate_hz, self._on_status)

    def start(self) -> None:
        self._view.start()

    def catch_up(self) -> None:
        """See ``EngineView``."""
        self._view.catch_up()

    def close(self) -> None:
        self._view.close()

    def _on_status(self, status: StatusSnapshot | None) -> None:
        robot = self._robot
        contact = read_contact(status, robot.estop_input_byte, robot.estop_input_bit)
        self.reading = None if status is None else drive_reading(status, contact, robot.latch, robot.safety_edge)

"""Node joystick_driver: publishes /teleop/cmd_vel from a joystick with a dead-man button."""

from __future__ import annotations

from functools import partial

from robot_stack.contract import frames, topics
from robot_stack.core.geometry import ZERO_TWIST
from robot_stack.core.runtime import runtime_dir
from robot_stack.drivers.joystick.events import Decoder, EventRefused
from robot_stack.drivers.joystick.params import JoystickDriverParams
from robot_stack.drivers.joystick.teleop import Teleop
from robot_stack.drivers.nodes.event_reader import EventReader
from robot_stack.middleware.conversions import twist_stamped
from robot_stack.middleware.node import StackNode, run


class JoystickDriverNode(StackNode):
    """Handles events as they arrive; publishes at the contract's rate while there is a command."""

    def __init__(self) -> None:
        super().__init__("joystick_driver", JoystickDriverParams)
        self._teleop, self._decoder = Teleop(self.params), Decoder()
        self._problem = ""
        self._commands = self.advertise(topics.TELEOP_CMD_VEL)
        # An absolute path replaces the runtime folder.
        device = str(runtime_dir() / self.params.device)
        self.set_health(False, f"waiting for the joystick {device}")
        self._reader = EventReader(device, self.params.reopen_s, self._on_bytes, self._on_lost)
        self.every(topics.TELEOP_CMD_VEL.nominal_rate_hz, self._command)
        self.every(2.0, self._watch)

    def _on_bytes(self, data: bytes) -> None:
        self.call_soon(partial(self._take, data))

    def _on_lost(self) -> None:
        self.call_soon(self._lose)

    def _take(self, data: bytes) -> None:
        now_s = self.steady_s()
        try:
            for event in self._decoder.feed(data):
                self._teleop.received(event, now_s)
        except EventRefused as refusal:
            self._problem = str(refusal)
            self._lose()
            self._reader.open_anew()
        else:
            self._problem = ""

    def _lose(self) -> None:
        self._decoder = Decoder()
        self._teleop.lost(self.steady_s())

    def on_emergency_stop(self) -> None:
        self._teleop.stopped(self.steady_s())

    def _command(self) -> None:
        if self.emergency_stop:
            self._teleop.stopped(self.steady_s())  # also one that is pressed while the stop lasts
        twist = self._teleop.command(self.steady_s())
        if twist is not None:
            self._commands.publish(twist_stamped(twist, frames.BASE_LINK, self.stamp()))

    def _watch(self) -> None:
        is_open = self._reader.state.endswith("is open") and not self._problem
        self.set_health(is_open, "the joystick is connected" if is_open else self._problem or self._reader.state)
        self.report.values |= {"device": self._reader.state, "dead-man button": self._teleop.grip.value}

    def safe_output(self) -> None:
        """Publishes a zero command if the joystick controls the robot."""
        if self._teleop.command(self.steady_s()) is not None:
            self._commands.publish(twist_stamped(ZERO_TWIST, frames.BASE_LINK, self.stamp()))

    def destroy_node(self) -> None:
        self._reader.close()
        super().destroy_node()


def main() -> None:
    run(JoystickDriverNode)

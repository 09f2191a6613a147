"""Node joystick_driver: publishes /teleop/cmd_vel from a joystick with a dead-man button."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from robot_stack.contract import frames, topics
from robot_stack.core.geometry import ZERO_TWIST
from robot_stack.core.runtime import runtime_dir
from robot_stack.drivers.joystick.events import Event
from robot_stack.drivers.joystick.params import JoystickDriverParams
from robot_stack.drivers.joystick.teleop import Teleop
from robot_stack.drivers.nodes.joystick_file import JoystickFile
from robot_stack.middleware.conversions import twist_stamped
from robot_stack.middleware.device_thread import DeviceThread
from robot_stack.middleware.node import StackNode


class JoystickDriverNode(StackNode):
    """Handles events as they arrive; publishes at the contract's rate while there is a command."""

    def __init__(self) -> None:
        super().__init__("joystick_driver", JoystickDriverParams)
        self._teleop = Teleop(self.params)
        self._commands = self.advertise(topics.TELEOP_CMD_VEL)
        # An absolute path replaces the runtime folder.
        device = str(runtime_dir() / self.params.device)
        self.set_health(False, f"waiting for the joystick {device}")
        self._thread = DeviceThread(JoystickFile(device, self._on_events, self._on_lost), self.params.reopen_s)
        self.at_end.callback(self._thread.close)
        self.every(topics.TELEOP_CMD_VEL.nominal_rate_hz, self._command)
        self.every(2.0, self._watch)

    def _on_events(self, events: Sequence[Event]) -> None:
        self.call_soon(partial(self._take, events))

    def _on_lost(self) -> None:
        self.call_soon(self._lose)

    def _take(self, events: Sequence[Event]) -> None:
        now_s = self.steady_s()
        for event in events:
            self._teleop.received(event, now_s)

    def _lose(self) -> None:
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
        state = self._thread.state
        is_open = self._thread.is_open
        self.set_health(is_open, "the joystick is connected" if is_open else state)
        self.report.values |= {"device": state, "dead-man button": self._teleop.grip.value}

    def safe_output(self) -> None:
        """Publishes a zero command if the joystick controls the robot."""
        if self._teleop.command(self.steady_s()) is not None:
            self._commands.publish(twist_stamped(ZERO_TWIST, frames.BASE_LINK, self.stamp()))

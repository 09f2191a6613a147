"""Executes motion messages: each is checked as a whole, then sent in one call that starts all axes or none."""

from __future__ import annotations

from robot_stack.wmx.api import AxisCommandMode, ErrorCode, Velocity_TimedVelCommand
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.general.commands import (
    AxisOrder,
    CommandLimits,
    check_order,
    check_ready,
    from_present,
    position_commands,
    timed_velocity_commands,
    velocity_commands,
)
from robot_stack.wmx.general.device import Device
from robot_stack.wmx.general.requests import Refused
from robot_stack.wmx.timed_velocity import start


class AxisMotion:
    """Moves the axes of one device. Every method may raise Refused, which changes nothing.

    velocity_timeout_s: 0, or how long a velocity holds without another message. The engine counts this time, so that it
    works without this node too.
    """

    def __init__(self, device: Device, velocity_timeout_s: float, limits: CommandLimits) -> None:
        self._device, self._timeout_s, self._limits = device, velocity_timeout_s, limits

    def run(self, order: AxisOrder) -> None:
        """Velocities."""
        snapshot = self._ready(order, AxisCommandMode.Velocity)
        timed: list[Velocity_TimedVelCommand] = []
        endless = velocity_commands(order)
        if self._timeout_s:
            timed, endless = timed_velocity_commands(order, snapshot, self._timeout_s)
        code = self._device.call(lambda engine: start(engine.core_motion, endless, timed))
        self._begun(code, order, snapshot)

    def go_to(self, order: AxisOrder) -> None:
        """Absolute positions."""
        self._position(order, self._ready(order, AxisCommandMode.Position))

    def go_by(self, order: AxisOrder) -> None:
        """Positions relative to the present ones."""
        snapshot = self._ready(order, AxisCommandMode.Position)
        absolute = from_present(order, snapshot)
        if absolute is not None:
            self._position(absolute, snapshot)
            return
        commands = position_commands(order)
        code = self._device.call(lambda engine: engine.core_motion.motion.StartMov(len(commands), commands))
        self._begun(code, order, snapshot)

    def _ready(self, order: AxisOrder, mode: AxisCommandMode) -> StatusSnapshot:
        check_order(order, self._limits)
        code, snapshot = self._device.read()
        if snapshot is None:
            raise Refused(f"no status of the engine: Error={int(code)} ({self._device.base_text(code)})")
        check_ready(order.index, mode, snapshot)
        return snapshot

    def _position(self, order: AxisOrder, snapshot: StatusSnapshot) -> None:
        commands = position_commands(order)
        code = self._device.call(lambda engine: engine.core_motion.motion.StartPos(len(commands), commands))
        self._begun(code, order, snapshot)

    def _begun(self, code: int, order: AxisOrder, snapshot: StatusSnapshot) -> None:
        if code == ErrorCode.APIChannelTimeOut:
            self._device.doubt(order.index)
        if code:
            raise Refused(f"the engine refuses it: Error={int(code)} ({self._device.motion_text(code)})")
        self._device.moved(order.index, snapshot)

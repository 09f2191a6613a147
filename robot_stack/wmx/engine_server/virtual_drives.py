"""Servo drives without physics: a first-order lag between command and feedback, with faults to inject.

For running the engine by itself and for testing it. A drive that is on follows the commanded position (position mode)
or the integral of the commanded velocity with the time constant ``lag_s``; off, it keeps its position.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.bus import MODE_POSITION, DriveCommands, DriveFeedback


class VirtualDrives:
    """A ServoBus with faults to inject.

    ``alarms``: code per drive, cleared on request unless ``stubborn``. ``broken``: drives that cannot be on.
    ``frozen``: drives whose encoder stands still. ``connected``: False loses the bus, ``lose_cycles`` loses it for that
    many cycles. ``inputs``: bytes of the input image; ``outputs``: the output image last received.
    """

    def __init__(self, n_axes: int, cycle_time_s: float, lag_s: float = 0.005, servo_delay_cycles: int = 2) -> None:
        self.n_axes = n_axes
        self.connected = True
        self.lose_cycles = 0
        self.stubborn = False
        self.alarms: NDArray[np.int32] = np.zeros(n_axes, np.int32)
        self.broken: NDArray[np.bool_] = np.zeros(n_axes, np.bool_)
        self.frozen: NDArray[np.bool_] = np.zeros(n_axes, np.bool_)
        self.inputs: dict[int, int] = {}
        self.outputs: NDArray[np.uint8] = np.zeros(0, np.uint8)
        self.torque_percent: NDArray[np.float64] = np.zeros(n_axes)
        self._cycle_s = cycle_time_s
        self._gain = 1.0 if lag_s <= 0.0 else -math.expm1(-cycle_time_s / lag_s)
        self._servo_delay = servo_delay_cycles
        self._switching: NDArray[np.int64] = np.zeros(n_axes, np.int64)
        self.servo_on: NDArray[np.bool_] = np.zeros(n_axes, np.bool_)
        self.position: NDArray[np.float64] = np.zeros(n_axes)
        self.velocity: NDArray[np.float64] = np.zeros(n_axes)

    def exchange(self, out: DriveCommands, inp: DriveFeedback) -> bool:
        """One cycle of every drive."""
        if not self.connected:
            self.servo_on.fill(False)
            self.velocity.fill(0.0)
            return False
        if self.lose_cycles > 0:
            self.lose_cycles -= 1
            return False
        self._switch(out)
        self._move(out)
        self.outputs = out.outputs.copy()
        live = ~self.frozen
        inp.position_counts[live] = np.rint(self.position[live])
        inp.velocity_counts_per_s[:] = np.where(live, self.velocity, 0.0)
        inp.torque_percent[:] = self.torque_percent
        inp.servo_on[:] = self.servo_on
        inp.alarm_code[:] = self.alarms
        for byte, value in self.inputs.items():
            inp.inputs[byte] = value
        return True

    def _switch(self, out: DriveCommands) -> None:
        if not self.stubborn:
            self.alarms[out.clear_alarm] = 0
        wanted = out.servo_on & (self.alarms == 0) & ~self.broken
        self._switching = np.where(wanted & ~self.servo_on, self._switching + 1, 0)
        self.servo_on = wanted & (self.servo_on | (self._switching > self._servo_delay))

    def _move(self, out: DriveCommands) -> None:
        in_position_mode, before = out.mode == MODE_POSITION, self.position
        followed = before + self._gain * (out.position_counts - before)
        velocity = self.velocity + self._gain * (out.velocity_counts_per_s - self.velocity)
        after = np.where(in_position_mode, followed, before + velocity * self._cycle_s)
        self.position = np.where(self.servo_on, after, before)
        speed = np.where(in_position_mode, (after - before) / self._cycle_s, velocity)
        self.velocity = np.where(self.servo_on, speed, 0.0)

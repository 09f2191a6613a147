"""The joystick's command: zero unless the dead-man button is held and events arrive."""

from __future__ import annotations

import math
from enum import Enum

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.drivers.joystick.events import Event
from robot_stack.drivers.joystick.params import JoystickAxis, JoystickDriverParams


class Grip(Enum):
    RELEASED = "released"
    HELD = "held"
    REFUSED = "pressed, but has to be released first"


class Teleop:
    """Call for every event. Times are plain steady seconds.

    The button counts when it is pressed while the sticks are centred. If it was down when the device was opened or
    at a stop, or was pressed with a stick deflected, it must be released first.
    """

    def __init__(self, params: JoystickDriverParams) -> None:
        self._params = params
        self._axes: dict[int, float] = {}
        self._grip = Grip.RELEASED
        self._felt_s = -math.inf
        self._released_s = -math.inf

    @property
    def grip(self) -> Grip:
        return self._grip

    def received(self, event: Event, now_s: float) -> None:
        self._felt_s = now_s
        if not event.button:
            self._axes[event.number] = event.value
        elif event.number == self._params.dead_man_button:
            self._press(event, now_s)

    def lost(self, now_s: float) -> None:
        """The device was disconnected: clears its state."""
        self._axes.clear()
        self._let_go(Grip.RELEASED, now_s)

    def stopped(self, now_s: float) -> None:
        """An emergency stop: a held button has no effect until it is pressed again."""
        if self._grip is Grip.HELD:
            self._let_go(Grip.REFUSED, now_s)

    def command(self, now_s: float) -> Twist2 | None:
        """base_link, m/s and rad/s; None: no command, and the drive is left to others."""
        if self._grip is Grip.HELD and not now_s - self._felt_s <= self._params.quiet_s:
            self._let_go(Grip.REFUSED, now_s)
        if self._grip is Grip.HELD:
            forward, left, turn = self._params.forward_mps, self._params.left_mps, self._params.turn_radps
            return Twist2(self._scaled(forward), self._scaled(left), self._scaled(turn))
        return ZERO_TWIST if now_s - self._released_s <= self._params.zero_s else None

    def _press(self, event: Event, now_s: float) -> None:
        if not event.value:
            self._let_go(Grip.RELEASED, now_s)
        elif event.initial or not self._centred():
            self._let_go(Grip.REFUSED, now_s)
        elif self._grip is Grip.RELEASED:
            self._grip = Grip.HELD

    def _let_go(self, grip: Grip, now_s: float) -> None:
        if self._grip is Grip.HELD:
            self._released_s = now_s
        self._grip = grip

    def _centred(self) -> bool:
        axes = (self._params.forward_mps, self._params.left_mps, self._params.turn_radps)
        return all(self._scaled(axis) == 0.0 for axis in axes)

    def _scaled(self, axis: JoystickAxis) -> float:
        """From 0 at the edge of the dead zone to 1 at the end."""
        value, zone = self._axes.get(axis.number, 0.0), self._params.dead_zone
        return math.copysign(max(0.0, abs(value) - zone) / (1.0 - zone), value) * axis.full

"""The two-key rule of the emergency stop, as every node applies it: whether this node may act.

``/emergency_stop`` true stops at once. A false alone releases nothing, because another source may still be pressed:
``/safety/status`` must also report the end of the emergency. A machine without a safety monitor has one key only, until
a monitor publishes.
"""

from __future__ import annotations


class StopLatch:
    """Active from the first ``true``, or emergency in the status, until the last is false and the status clean.

    monitored: a safety monitor belongs to the machine, whether or not its status has arrived yet.
    """

    def __init__(self, *, monitored: bool = True) -> None:
        self._monitored = monitored
        self._pressed = False
        self._emergency = False
        self._waiting_for_status = False

    @property
    def active(self) -> bool:
        return self._pressed or self._emergency or self._waiting_for_status

    def on_emergency_stop(self, pressed: bool) -> None:
        if pressed:
            # A status in flight may be older than the press: wait for one that shows the emergency, and accept a clean
            # status only after it.
            self._waiting_for_status = self._monitored and not self._emergency
        self._pressed = pressed

    def on_safety_status(self, emergency: bool) -> None:
        self._monitored = True
        if emergency:
            self._waiting_for_status = False
        self._emergency = emergency

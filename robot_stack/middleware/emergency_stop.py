"""One source of the emergency stop: its messages on ``/emergency_stop``, and its name."""

from __future__ import annotations

import threading
from collections.abc import Callable

from builtin_interfaces.msg import Time
from std_msgs.msg import Bool

from custom_msgs.msg import EmergencyStopSource
from robot_stack.middleware.port import Publisher


class StopSource:
    """Publishes on ``/emergency_stop`` and reports each message, with its author, on ``/emergency_stop/sources``.

    Call ``repeat`` at the rate of that topic. May be used from any thread.
    """

    def __init__(
        self,
        name: str,
        process_id: int,
        stop: Publisher,
        sources: Publisher,
        stamp: Callable[[], Time],
        *,
        until_latched: bool = False,
    ) -> None:
        """until_latched: its press is an event, not a state: it ends once the safety monitor has latched it."""
        self._name, self._process_id = name, process_id
        self._stop, self._sources, self._stamp = stop, sources, stamp
        self._until_latched = until_latched
        self._turn = threading.Lock()
        self._begun = stamp()
        self._presses = 0
        self._pressed = False

    @property
    def listeners(self) -> int:
        """Subscribers of ``/emergency_stop`` that are connected."""
        return int(self._stop.get_subscription_count())

    def publish(self, pressed: bool) -> None:
        """True: stop. False: a request to release."""
        with self._turn:
            self._stop.publish(Bool(data=pressed))
            self._presses += pressed
            self._pressed = pressed
            self._report()

    def repeat(self) -> None:
        """Reports again its name and whether it is pressed."""
        with self._turn:
            self._report()

    def on_latched(self) -> None:
        """Called when the safety monitor reports the emergency stop."""
        if self._until_latched and self._pressed:
            with self._turn:
                self._pressed = False
                self._report()

    def _report(self) -> None:
        self._sources.publish(
            EmergencyStopSource(
                stamp=self._stamp(),
                name=self._name,
                pid=self._process_id,
                begun=self._begun,
                presses=self._presses,
                pressed=self._pressed,
            )
        )

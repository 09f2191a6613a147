"""Selects when camera images are recorded: two cameras make 18 MB/s, which are useful only during docking."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from robot_stack.contract.states import DockingState

IMAGE_TYPE = "sensor_msgs/msg/Image"
# States in which no docking is under way; DOCKED lasts for the whole ride with a chair.
_AT_REST = frozenset({DockingState.IDLE, DockingState.DOCKED, DockingState.FAILED})


@dataclass(slots=True)
class DockingWatch:
    """True during a docking and until ``tail_s`` after it. A silent controller ends it as well."""

    tail_s: float
    _last_active_s: float = -math.inf

    def on_status(self, state: str, now_s: float) -> None:
        if state not in _AT_REST:
            self._last_active_s = now_s

    def active(self, now_s: float) -> bool:
        return now_s - self._last_active_s <= self.tail_s


@dataclass(slots=True)
class Thinning:
    """Passes ``rate_hz`` messages per second of each topic."""

    rate_hz: float
    _due_s: dict[str, float] = field(default_factory=dict)

    def keeps(self, topic: str, now_s: float) -> bool:
        due_s = self._due_s.get(topic, -math.inf)
        period_s = 1.0 / self.rate_hz
        # If the clock was set back, the images must not pause for that time.
        if due_s - period_s <= now_s < due_s:
            return False
        # In regular steps while messages arrive; after a gap from the present time.
        late = now_s - due_s > period_s or now_s < due_s
        self._due_s[topic] = (now_s if late else due_s) + period_s
        return True

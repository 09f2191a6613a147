"""The warning before autonomous motion starts after a long standstill: light and chime for some seconds.

ISO 3691-4 asks for at least 2 s of warning after a stop of more than 10 s. The node that starts the motion gives it:
the mission manager, navigation for a goal given by hand, docking for a manual docking request. A warning given by
another node counts too. Times are sums of tick steps, so that a clock jump does not end a warning.
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config
from robot_stack.core.geometry import Twist2

# The node's status text while it warns.
SETTING_OUT = "about to start: warning persons around the robot"


class DepartureParams(Config):
    """``config/departure.yaml``.

    after_s: standstill after which a warning is due. warning_s: its duration. standstill_*: speeds that count as zero.
    """

    after_s: Annotated[float, Field(gt=0.0, le=10.0)]
    warning_s: Annotated[float, Field(ge=2.0, le=30.0)]
    standstill_speed_mps: Annotated[float, Field(gt=0.0, le=0.2)]
    standstill_yaw_rate_radps: Annotated[float, Field(gt=0.0, le=0.2)]


class Departure:
    """Tracks the time since the robot moved or was announced to move; infinite at first.

    announced: no warning is due at first.
    """

    def __init__(self, params: DepartureParams, *, announced: bool = False) -> None:
        self._params = params
        self._stood_s = 0.0 if announced else math.inf
        self._warned_s = 0.0
        self._warning = self._moving = False
        self._remaining_s: float | None = None

    @property
    def due(self) -> bool:
        """True if a warning must precede the next motion."""
        return self._stood_s > self._params.after_s

    @property
    def moving(self) -> bool:
        return self._moving

    @property
    def stood_s(self) -> float:
        return self._stood_s

    @property
    def warning(self) -> bool:
        """True while the warning is given."""
        return self._warning

    @property
    def remaining_s(self) -> float | None:
        """Seconds until the robot starts, 0 once as it starts, to be published; None: nothing to publish."""
        return self._remaining_s

    def elapse(self, twist: Twist2 | None, dt_s: float) -> None:
        """Advances the time. Without a usable twist the robot counts as standing."""
        self._remaining_s = None
        self._moving = twist is not None and twist.is_finite() and not self._stands(twist)
        self._stood_s = 0.0 if self._moving else self._stood_s + dt_s

    def announced(self) -> None:
        """Another node has given the full warning."""
        self._stood_s = 0.0

    def drop(self) -> None:
        """Cancels the departure: the next warning is given in full."""
        self._warning, self._warned_s, self._remaining_s = False, 0.0, None

    def cleared(self, dt_s: float) -> bool:
        """True once the robot may start. Call every tick while it wants to start, after ``elapse``."""
        if not self.due:
            self.drop()
            return True
        if self._warning:
            self._warned_s += dt_s
        self._warning = True
        # Steps of a clock do not add up exactly.
        if self._warned_s < self._params.warning_s - 1e-9:
            self._remaining_s = self._params.warning_s - self._warned_s
            return False
        self.drop()
        self._stood_s, self._remaining_s = 0.0, 0.0
        return True

    def _stands(self, twist: Twist2) -> bool:
        p = self._params
        return twist.speed() <= p.standstill_speed_mps and abs(twist.omega) <= p.standstill_yaw_rate_radps

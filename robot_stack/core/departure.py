"""The warning before the robot begins to move by itself: light and chime for a while after it has stood for long.

ISO 3691-4 asks for at least 2 s of it after a stop of more than 10 s. Whoever lets the robot go gives it: the mission
manager, navigation for a goal given by hand, docking for a docking asked for by hand. A warning that another has given
counts as one's own. Times are sums of the ticks' steps, so that a clock that jumps ends no warning.
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config
from robot_stack.core.geometry import Twist2

# What a node says of itself while it warns.
SETTING_OUT = "about to set out: warning people around"


class DepartureParams(Config):
    """``config/departure.yaml``.

    after_s: a stop of longer than this is warned of. warning_s: for so long. Up to the standstill speeds it stands.
    """

    after_s: Annotated[float, Field(gt=0.0, le=10.0)]
    warning_s: Annotated[float, Field(ge=2.0, le=30.0)]
    standstill_speed_mps: Annotated[float, Field(gt=0.0, le=0.2)]
    standstill_yaw_rate_radps: Annotated[float, Field(gt=0.0, le=0.2)]


class Departure:
    """Knows how long the robot has stood since it moved or was announced to move; at first for ever.

    announced: at first nobody need be warned.
    """

    def __init__(self, params: DepartureParams, *, announced: bool = False) -> None:
        self._params = params
        self._stood_s = 0.0 if announced else math.inf
        self._warned_s = 0.0
        self._warning = self._moving = False
        self._remaining_s: float | None = None

    @property
    def due(self) -> bool:
        """People do not expect it to move any more: a warning comes before it does."""
        return self._stood_s > self._params.after_s

    @property
    def moving(self) -> bool:
        return self._moving

    @property
    def stood_s(self) -> float:
        return self._stood_s

    @property
    def warning(self) -> bool:
        """The warning is being given."""
        return self._warning

    @property
    def remaining_s(self) -> float | None:
        """What others are to be told now: seconds until it sets out, 0 once as it does; None: nothing."""
        return self._remaining_s

    def elapse(self, twist: Twist2 | None, dt_s: float) -> None:
        """Time passes. A robot of which nobody knows that it moves stands."""
        self._remaining_s = None
        self._moving = twist is not None and twist.is_finite() and not self._stands(twist)
        self._stood_s = 0.0 if self._moving else self._stood_s + dt_s

    def announced(self) -> None:
        """Somebody else has given the warning in full."""
        self._stood_s = 0.0

    def drop(self) -> None:
        """It shall not move after all: the next warning is given in full."""
        self._warning, self._warned_s, self._remaining_s = False, 0.0, None

    def cleared(self, dt_s: float) -> bool:
        """True once it may set out; to be called every tick for as long as it wants to, after ``elapse``."""
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

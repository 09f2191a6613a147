"""The latch as a mechanism on the engine's I/O: two outputs that drive its hooks, two inputs for their position.

The hooks run while exactly one output is on and stay where they are otherwise: a bus that is cut, an engine that goes
down, or both outputs at once change nothing. Closed hooks that have taken a wheelchair draw it in by themselves.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Final

from sim.params import LatchMechanism
from sim.plant.drives import ServoDrives
from sim.plant.wheelchair import Chair

_OPEN, _CLOSED = 0.0, 1.0


class Hooks(IntEnum):
    """State of the hooks with respect to a wheelchair."""

    FREE = 0
    DRAWING = 1
    HOLDING = 2


class Latch:
    """The hooks. Call ``step`` every cycle, after the drives have received the engine's telegram.

    stuck, no_confirm: faults, see sim/plant/faults.py.
    """

    def __init__(self, params: LatchMechanism, drives: ServoDrives, chair: Chair | None, dt_s: float) -> None:
        self._params, self._drives, self._chair = params, drives, chair
        self._travel: Final = dt_s / params.travel_s
        self._draw: Final = dt_s / params.draw_in_s
        self._position = _OPEN
        self._drawn = 0.0
        self._failed_open = False
        self.hooks = Hooks.FREE
        self.stuck = False
        self.no_confirm = False
        self._publish()

    @property
    def closed(self) -> bool:
        """A wheelchair hangs on the closed hooks."""
        return self.hooks is Hooks.HOLDING and self._position == _CLOSED

    @property
    def open(self) -> bool:
        return self._position == _OPEN

    def step(self) -> None:
        """One cycle."""
        if self.hooks is Hooks.DRAWING:
            self._draw_in()
        close, open_ = self._drives.latch_outputs
        if close != open_ and not self.stuck and not self._failed_open:
            self._run(self._travel if close else -self._travel)

    def _run(self, by: float) -> None:
        before = self._position
        self._position = min(_CLOSED, max(_OPEN, before + by))
        if self._position == before:
            return
        if self._position == _CLOSED and self.hooks is Hooks.FREE:
            self._take()
        elif self._position == _OPEN:
            self._let_go()
        self._publish()

    def _take(self) -> None:
        """Handles closed hooks: they hold the rails' ends, or nothing."""
        chair, limits = self._chair, self._params
        if chair is None or not chair.in_sight:
            return
        along, across, height, yaw = (abs(float(value)) for value in chair.misalignment())
        if max(along, across) <= limits.capture_m and yaw <= limits.capture_rad and height <= limits.capture_height_m:
            self.hooks, self._drawn = Hooks.DRAWING, 0.0
            chair.catch()

    def _draw_in(self) -> None:
        assert self._chair is not None
        self._drawn = min(1.0, self._drawn + self._draw)
        self._chair.draw(self._drawn)
        if self._drawn == 1.0:
            self.hooks = Hooks.HOLDING
            self._publish()

    def _let_go(self) -> None:
        if self._chair is not None and self.hooks is not Hooks.FREE:
            self._chair.release()
        self.hooks = Hooks.FREE

    def _publish(self) -> None:
        self._drives.set_latch_inputs(closed=self.closed and not self.no_confirm, open_=self.open)

    # --- from outside ---------------------------------------------------------------------------------------------

    def set_no_confirm(self, active: bool) -> None:
        """Disables the switch for closed hooks."""
        self.no_confirm = active
        self._publish()

    def fail_open(self, active: bool) -> None:
        """Releases at once and stays open while active."""
        self._failed_open = active
        if active:
            self.force(closed=False)

    def force(self, closed: bool) -> None:
        """At once closed on the wheelchair in the dock pose, or open."""
        self._position = _CLOSED if closed else _OPEN
        if closed:
            assert self._chair is not None
            self._chair.attach()
            self.hooks, self._drawn = Hooks.HOLDING, 1.0
        else:
            self._let_go()
        self._publish()

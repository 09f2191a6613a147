"""What can go wrong with the simulated LiDAR, on request: what ``/sim/inject_lidar_fault`` may ask for."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim.lidar.sensor import CLEAR, Conditions

CLEAR_ALL = "clear"
SILENT, FROZEN, NOISY, RATE, COVERED = "silent", "frozen", "noisy", "rate", "covered"


class LidarFaultRefused(Exception):
    """A fault that does not exist, or not with this value. The message says what would be accepted."""


@dataclass(frozen=True, slots=True)
class LidarFaultKind:
    """One row. value: what it means, within low..high; default replaces 0."""

    name: str
    what: str
    value: str
    low: float
    high: float
    default: float


KINDS = (
    LidarFaultKind(SILENT, "the LiDAR sends nothing", "none", 0.0, 0.0, 0.0),
    LidarFaultKind(FROZEN, "the LiDAR repeats its last points with new stamps", "none", 0.0, 0.0, 0.0),
    LidarFaultKind(NOISY, "ranges are noisier", "factor", 1.0, 100.0, 5.0),
    LidarFaultKind(RATE, "the LiDAR turns slower", "sweeps per second", 0.1, 10.0, 2.0),
    LidarFaultKind(COVERED, "the lens is covered, from the front on", "share of the circle", 0.01, 1.0, 1.0),
)
BY_NAME = {kind.name: kind for kind in KINDS}


class LidarFaults:
    """The faults in force."""

    def __init__(self) -> None:
        self._active: dict[str, tuple[float, float]] = {}  # kind -> value, end

    def inject(self, kind: str, target: str, value: float, duration_s: float, now_s: float) -> str:
        """Raises a fault for ``duration_s`` (0: until cleared); returns what was done. Raises LidarFaultRefused.

        ``clear`` as the kind ends the fault that ``target`` names (empty: all); other kinds have no target.
        """
        if kind == CLEAR_ALL:
            return self._clear(target)
        row = BY_NAME.get(kind)
        if row is None:
            raise LidarFaultRefused(f"no LiDAR fault {kind!r}; there are {', '.join(BY_NAME)} and {CLEAR_ALL}")
        if target:
            raise LidarFaultRefused(f"{kind}: target must be empty, there is one LiDAR; is {target!r}")
        if not math.isfinite(duration_s) or duration_s < 0.0:
            raise LidarFaultRefused(f"{kind}: duration_s must be 0 or more, is {duration_s}")
        amount = value if value != 0.0 else row.default
        if not row.low <= amount <= row.high:
            raise LidarFaultRefused(f"{kind}: value ({row.value}) must be in {row.low:g}..{row.high:g}, is {value}")
        self._active[kind] = (amount, now_s + duration_s if duration_s > 0.0 else math.inf)
        return row.what + (f", {row.value} {amount:g}" if row.default else "")

    def value(self, kind: str, now_s: float) -> float | None:
        """Of a fault in force; None if it is not."""
        self._active = {key: item for key, item in self._active.items() if item[1] > now_s}
        item = self._active.get(kind)
        return None if item is None else item[0]

    def conditions(self, now_s: float) -> Conditions:
        """What the sensor measures through now."""
        if not self._active:
            return CLEAR
        return Conditions(self.value(NOISY, now_s) or 1.0, self.value(COVERED, now_s) or 0.0)

    def _clear(self, target: str) -> str:
        if target and target not in BY_NAME:
            raise LidarFaultRefused(f"no LiDAR fault {target!r}; there are {', '.join(BY_NAME)}")
        gone = [kind for kind in self._active if not target or kind == target]
        for kind in gone:
            del self._active[kind]
        return f"cleared: {', '.join(gone) or 'nothing'}"

"""Faults of a simulated sensor: raising one changes nothing at once; the sensor queries the active faults at each
measurement.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sim.plant.fault_table import CLEAR, FaultKind, FaultTable

ONE_SENSOR = ("",)


def sensor_fault(
    name: str,
    what: str,
    value: tuple[str, float, float, float] = ("none", 0.0, 0.0, 0.0),
    targets: tuple[str, ...] = ONE_SENSOR,
) -> FaultKind:
    """One row. value: its meaning, its bounds, and the default for 0."""
    meaning, low, high, default = value

    def describe(_: object, target: str, amount: float | None) -> str:
        of = f": {target}" if target else ""
        return what + of + (f", {meaning} {amount:g}" if default and amount is not None else "")

    return FaultKind(name, what, targets, meaning, describe, low, high, default)


class SensorFaults:
    """The faults in force. one_of: kinds of which only the newest is active. Times are those of the sensor's stamps."""

    def __init__(self, kinds: Mapping[str, FaultKind], one_of: Sequence[str] = ()) -> None:
        self.time_s = 0.0
        self._kinds, self._one_of = kinds, one_of
        self._table = FaultTable(self, kinds)

    def inject(self, kind: str, target: str, value: float, duration_s: float, now_s: float) -> str:
        """Raises a fault for ``duration_s`` (0: until cleared); returns what was done. Raises FaultRefused.

        target: one of the kind's; empty: all of them. ``clear``: see ``FaultTable``.
        """
        self._at(now_s)
        row = self._kinds.get(kind)
        targets = row.targets if row is not None and row.targets and not target else (target,)
        done = [self._table.inject(kind, one, value, duration_s) for one in targets]
        if kind in self._one_of:
            for other in (self.active(now_s) & {(name, "") for name in self._one_of}) - {(kind, "")}:
                self._table.inject(CLEAR, other[0])
        return "; ".join(done)

    def active(self, now_s: float) -> set[tuple[str, str]]:
        """(kind, target) of every fault in force."""
        self._at(now_s)
        return {(fault.kind, fault.target) for fault in self._table.active}

    def value(self, kind: str, now_s: float, target: str = "") -> float | None:
        """Of a fault in force; None if it is not."""
        self._at(now_s)
        return next((f.value for f in self._table.active if (f.kind, f.target) == (kind, target)), None)

    def _at(self, now_s: float) -> None:
        self.time_s = now_s
        self._table.update()

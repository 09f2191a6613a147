"""Faults that can be raised for a while or until they are cleared: the mechanism, for any plant."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

CLEAR = "clear"


class FaultRefused(Exception):
    """A fault that does not exist, or not with this target or value. The message names the accepted ones."""


class Timed(Protocol):
    """A system under faults, with a time of its own."""

    @property
    def time_s(self) -> float: ...


@dataclass(frozen=True, slots=True)
class FaultKind:
    """One row.

    what: in words; targets: names accepted as target, None for free text that ``change`` checks.
    value: what the value means, bounded by low and high; ``default`` replaces 0 where 0 means nothing.
    change: given the plant, raises the fault with a value, ends it with None; returns a description.
    lasts: until it is cleared; otherwise it is a single event without an end.
    over_at: a value up to this ends the fault.
    """

    name: str
    what: str
    targets: tuple[str, ...] | None
    value: str
    change: Callable[[Any, str, float | None], str]
    low: float = 0.0
    high: float = 0.0
    default: float = 0.0
    lasts: bool = True
    over_at: float = -math.inf


@dataclass(frozen=True, slots=True)
class ActiveFault:
    """A fault in force; ``until_s`` is the plant's time, infinite for one that waits to be cleared."""

    kind: str
    target: str
    value: float
    until_s: float


class FaultTable:
    """The faults in force in one plant. ``kinds``: the possible ones, by name."""

    def __init__(self, plant: Timed, kinds: Mapping[str, FaultKind]) -> None:
        self._plant, self._kinds = plant, kinds
        self._active: dict[tuple[str, str], ActiveFault] = {}
        self._next_end_s = math.inf

    @property
    def active(self) -> tuple[ActiveFault, ...]:
        return tuple(self._active.values())

    def inject(self, kind: str, target: str = "", value: float = 0.0, duration_s: float = 0.0) -> str:
        """Raises a fault, for ``duration_s`` of simulated time or, with 0, until it is cleared.

        ``clear`` as the kind ends the fault of the kind named by ``target`` (``kind`` or ``kind:target``; empty: all).
        Returns what was done. Raises FaultRefused.
        """
        if kind == CLEAR:
            return self._clear_by_name(target)
        row = self._kinds.get(kind)
        if row is None:
            raise FaultRefused(f"no fault {kind!r}; there are {', '.join(self._kinds)} and {CLEAR}")
        if row.targets is not None and target not in row.targets:
            accepted = ", ".join(repr(name) if name else "''" for name in row.targets)
            raise FaultRefused(f"{kind}: target must be one of {accepted}, is {target!r}")
        amount = _checked_amount(row, value, duration_s)
        done = row.change(self._plant, target, amount)
        self._note(row, target, amount, duration_s)
        return done + (f" for {duration_s:g} s" if duration_s > 0.0 else "")

    def _note(self, row: FaultKind, target: str, amount: float, duration_s: float) -> None:
        until_s = self._plant.time_s + duration_s if duration_s > 0.0 else math.inf
        if not row.lasts or amount <= row.over_at:
            self._active.pop((row.name, target), None)  # an event, or the end of a fault, is not in force
        else:
            self._active[row.name, target] = ActiveFault(row.name, target, amount, until_s)
        self._plan()

    def update(self) -> None:
        """Ends expired faults; call it every step."""
        if self._plant.time_s < self._next_end_s:
            return
        for fault in self.active:
            if self._plant.time_s >= fault.until_s:
                self._end(fault)

    def _clear_by_name(self, name: str) -> str:
        kind, _, target = name.partition(":")
        if kind and kind not in self._kinds:
            raise FaultRefused(f"{CLEAR}: no fault {kind!r}; there are {', '.join(self._kinds)}")
        chosen = [item for item in self.active if kind in ("", item.kind) and target in ("", item.target)]
        for fault in chosen:
            self._end(fault)
        names = ", ".join(f"{item.kind}:{item.target}" if item.target else item.kind for item in chosen)
        return f"cleared {names}" if names else "nothing to clear"

    def _end(self, fault: ActiveFault) -> None:
        self._kinds[fault.kind].change(self._plant, fault.target, None)
        del self._active[fault.kind, fault.target]
        self._plan()

    def _plan(self) -> None:
        self._next_end_s = min((fault.until_s for fault in self._active.values()), default=math.inf)


def _checked_amount(kind: FaultKind, value: float, duration_s: float) -> float:
    """The amount of a fault requested by ``value``. Raises FaultRefused for an invalid value or duration."""
    if not math.isfinite(duration_s) or duration_s < 0.0:
        raise FaultRefused(f"{kind.name}: duration_s must be 0 or more, is {duration_s}")
    amount = value if value != 0.0 else kind.default
    if not kind.low <= amount <= kind.high or not math.isfinite(amount):
        raise FaultRefused(f"{kind.name}: value ({kind.value}) must be in {kind.low:g}..{kind.high:g}, is {value}")
    return amount

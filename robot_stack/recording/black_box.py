"""Kernel of the black box: which messages on the disk are kept, when a segment ends, which events are deleted.

Segments are files of a few seconds in a rolling window. An event keeps the segments from ``before_s`` before its first
trigger to ``after_s`` after its last one. Times in s of a steady clock unless stated otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from robot_stack.contract.faults import BY_CODE
from robot_stack.contract.graph import RECORDERS
from robot_stack.contract.model import SafetyAction

# Reasons beside the fault codes of the contract.
EMERGENCY_STOP = "EMERGENCY_STOP"  # of any source, or latched by the safety monitor
SAFETY_SILENT = "SAFETY_SILENT"  # /safety/status does not arrive
NODE_RESTARTED = "NODE_RESTARTED"  # a node runs in another process; faster than NODE_DEAD if it was killed
INTERRUPTED = "INTERRUPTED"  # an earlier black box has ended without completing its files

_STOPS = (SafetyAction.STOP, SafetyAction.EMERGENCY_STOP)
_BYTES_PER_GB = 1e9
_S_PER_DAY = 86_400.0
# Less than a robot runs that is switched off every night.
_CLOCK_SETTLED_S = 6 * 3600.0
_CLOCK_STEP_S = 60.0


class TriggerWatch:
    """Detects reasons that begin: a fault code, an emergency stop, a silent safety monitor, a restarted node. Each
    counts once until it is gone.

    ignored: fault codes that ordinary rides raise. silence_s: age of /safety/status that is a reason.
    settle_s: start-up raises faults until every node runs; so the faults count from the first status without a stop,
    or this long after the first status.
    """

    def __init__(self, ignored: Collection[str], silence_s: float, settle_s: float) -> None:
        self._ignored = frozenset(ignored)
        self._silence_s, self._settle_s = silence_s, settle_s
        self._first_s: float | None = None
        self._latest_s = math.inf
        self._armed = False
        self._active: frozenset[str] = frozenset()
        self._stopped = self._silent = False
        self._pids: dict[str, int] = {}

    def on_status(self, faults: Iterable[str], emergency_stop: bool, now_s: float) -> tuple[str, ...]:
        """faults: of /safety/status. emergency_stop: see ``on_emergency_stop``. Returns the reasons that begin."""
        if self._first_s is None:
            self._first_s = now_s
        self._latest_s, self._silent = now_s, False
        before, self._active = self._active, frozenset(faults) - self._ignored
        if not self._armed:
            stopped = emergency_stop or any(map(_stops, self._active))
            self._armed = not stopped or now_s - self._first_s >= self._settle_s
            self._stopped = emergency_stop
            return ()
        return (*sorted(self._active - before), *self.on_emergency_stop(emergency_stop))

    def on_emergency_stop(self, active: bool) -> tuple[str, ...]:
        """active: see ``StackNode.emergency_stop``. Returns the reason if the stop begins."""
        begins = self._armed and active and not self._stopped
        self._stopped = active
        return (EMERGENCY_STOP,) if begins else ()

    def on_nodes(self, pids: Mapping[str, int]) -> tuple[str, ...]:
        """pids: process id of each node by name. Returns the reason if a node has been restarted.

        Recorders do not count: a person starts and ends them.
        """
        restarted = any(self._pids.get(name, pid) != pid for name, pid in pids.items() if name not in RECORDERS)
        self._pids |= pids
        return (NODE_RESTARTED,) if restarted and self._armed else ()

    def check(self, now_s: float) -> tuple[str, ...]:
        """Returns the reason if the safety monitor has become silent."""
        if self._silent or not self._armed or now_s - self._latest_s <= self._silence_s:
            return ()
        self._silent = True
        return (SAFETY_SILENT,)


def _stops(code: str) -> bool:
    """An unknown code counts as a stop."""
    return code not in BY_CODE or BY_CODE[code].action in _STOPS


@dataclass(frozen=True, slots=True)
class Timing:
    """segment_bytes: a segment also ends beyond this size. event_max_s: a longer event is continued by another one."""

    before_s: float
    after_s: float
    segment_s: float
    segment_bytes: int
    event_max_s: float


@dataclass(frozen=True, slots=True)
class Step:
    """What is due, in this order: cut the open segment, end the event, begin one with all segments, drop segments."""

    cut: bool = False
    end: bool = False
    begin: bool = False
    drop: tuple[str, ...] = ()


@dataclass(slots=True)
class _Closed:
    name: str
    end_s: float


@dataclass(slots=True)
class Window:
    """The segments on the disk and the event under way. ``opened`` is called after each ``Step.cut``."""

    timing: Timing
    _closed: list[_Closed] = field(default_factory=list)
    _open: str | None = None
    _open_since_s: float = -math.inf
    _event_since_s: float | None = None
    _event_until_s: float = -math.inf

    @property
    def in_event(self) -> bool:
        return self._event_since_s is not None

    @property
    def segments(self) -> tuple[str, ...]:
        """All that are on the disk, oldest first, the open one last."""
        names = tuple(item.name for item in self._closed)
        return names if self._open is None else (*names, self._open)

    def opened(self, name: str, now_s: float) -> None:
        """A segment begins, which ends the one before."""
        self.closed(now_s)
        self._open, self._open_since_s = name, now_s

    def closed(self, now_s: float) -> None:
        """The open segment has ended without another, e.g. because the disk is full."""
        if self._open is not None:
            self._closed.append(_Closed(self._open, now_s))
        self._open = None

    def begin_event(self, now_s: float) -> None:
        """Begins an event, or goes on with that of an earlier black box."""
        self._event_since_s, self._event_until_s = now_s, now_s + self.timing.after_s

    def step(self, now_s: float, open_bytes: int, triggered: bool) -> Step:
        """open_bytes: size of the open segment. triggered: a reason has begun since the last call."""
        t = self.timing
        over = self._event_since_s is not None and now_s - self._event_since_s >= t.event_max_s
        if triggered and self._event_since_s is not None and not over:
            self._event_until_s = now_s + t.after_s
        end = self._event_since_s is not None and (now_s >= self._event_until_s or (over and triggered))
        begin = triggered and (end or self._event_since_s is None)
        full = now_s - self._open_since_s >= t.segment_s or open_bytes >= t.segment_bytes
        if end:
            self._event_since_s = None
        if begin:
            self.begin_event(now_s)
        # An event that begins takes all segments; its writer may need several steps for that.
        drop = () if triggered else tuple(item.name for item in self._closed if item.end_s < now_s - t.before_s)
        self._closed = [item for item in self._closed if item.name not in drop]
        return Step(cut=self._open is not None and (end or full), end=end, begin=begin, drop=drop)


class Retention:
    """What is older than some days is too old, once the system clock has run for six hours without a step: a wrong time
    that is corrected before deletes nothing.
    """

    def __init__(self, days: float) -> None:
        self._retention_s = days * _S_PER_DAY
        self._offset_s = self._since_s = math.inf

    def before_s(self, system_s: float, steady_s: float) -> float:
        """The time before which all is too old, in s since the epoch."""
        offset_s = system_s - steady_s
        if abs(offset_s - self._offset_s) > _CLOCK_STEP_S:
            self._offset_s, self._since_s = offset_s, steady_s
        return system_s - self._retention_s if steady_s - self._since_s >= _CLOCK_SETTLED_S else -math.inf


@dataclass(frozen=True, slots=True)
class Stored:
    """A completed event on the disk. number, at_s: see ``EventRecord``."""

    id: str
    number: int
    at_s: float
    bytes: int


def to_delete(events: Sequence[Stored], before_s: float, retention_gb: float, missing_bytes: float) -> tuple[str, ...]:
    """Ids of events to delete, the oldest first.

    before_s: of ``Retention``. An event that follows a younger one has a wrong time and stays.
    missing_bytes: what must be deleted so that the disk has room, <= 0 if it has. A disk that others have filled is no
    reason to lose events: for room, the newest stays, and the others go only if that suffices.
    """
    by_age = sorted(events, key=lambda item: (item.number, item.at_s, item.id))
    if missing_bytes > sum(event.bytes for event in by_age[:-1]):
        missing_bytes = 0.0
    chosen = []
    left = sum(event.bytes for event in events)
    for event in by_age:
        too_old = event.at_s < before_s
        too_many = left > retention_gb * _BYTES_PER_GB
        if not (too_old or too_many or missing_bytes > 0.0):
            break
        chosen.append(event.id)
        left -= event.bytes
        missing_bytes -= event.bytes
    return tuple(chosen)

"""Sources of the emergency stop, by name and process.

``/emergency_stop`` is one topic with many publishers and no names. Sources of this stack therefore also report their
identity on ``/emergency_stop/sources``, with each message there and periodically. A press stands until
the process that pressed reports its release, or until an operator clears it by name. Each true on
``/emergency_stop`` must be explained by a report of one more press; a true without a report in time is a press of a
source called ``unknown``. False messages release nothing here, because their source is unknown.

A source is one process: another one of the same name, at the same time or after it, is another source. The work for any
message is bounded, and so is the number of sources.

Times are steady seconds, given as arguments.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from robot_stack.core.stop_presence import Presence
from robot_stack.safety.timing import Hold, age_s

UNKNOWN = "unknown"
# This stack has fewer sources. Beyond this the longest silent one is dropped, a press of one more is unknown.
MOST_SOURCES = 64

Instance = tuple[str, int, int]


@dataclass(frozen=True, slots=True)
class SourceReport:
    """One message of ``/emergency_stop/sources``. presses: number of trues published by this process so far.
    begun_ns: when the process began, by its own clock.
    """

    name: str
    pid: int
    presses: int
    pressed: bool
    begun_ns: int = 0

    @property
    def instance(self) -> Instance:
        return self.name, self.pid, self.begun_ns


@dataclass(frozen=True, slots=True)
class Press:
    """A press that stands. name, pid, begun_ns: the process that pressed and alone may release it."""

    name: str
    pid: int
    begun_ns: int = 0

    @property
    def instance(self) -> Instance:
        return self.name, self.pid, self.begun_ns


@dataclass(frozen=True, slots=True)
class _Report:
    report: SourceReport
    at_s: float


class Arrivals:
    """Times of arrival with counts, oldest first. The cost of an operation does not depend on the counts."""

    def __init__(self) -> None:
        self._entries: deque[tuple[float, int]] = deque()

    def __bool__(self) -> bool:
        return bool(self._entries)

    def add(self, at_s: float, count: int = 1) -> None:
        if count > 0:
            self._entries.append((at_s, count))

    def take(self, count: int) -> int:
        """Removes up to ``count`` of the oldest; returns the number removed."""
        left = count
        while left > 0 and self._entries:
            at_s, there = self._entries.popleft()
            if there > left:
                self._entries.appendleft((at_s, there - left))
            left -= min(there, left)
        return count - left

    def expire(self, longest_s: float, now_s: float) -> list[tuple[float, int]]:
        """Removes and returns the entries older than ``longest_s``."""
        expired = []
        while self._entries and not age_s(now_s, self._entries[0][0]) <= longest_s:
            expired.append(self._entries.popleft())
        return expired


class StopSources:
    """Matches messages on ``/emergency_stop`` with the reports of their sources."""

    def __init__(self, explain_s: float, discovery_s: float, stale_s: float, presses: tuple[Press, ...] = ()) -> None:
        """explain_s: largest time between a true and the report that explains it. discovery_s: the same for a process
        without an earlier report: two topics of a new process are not discovered at the same time. stale_s:
        a source that is silent for longer is gone. presses: those that stood before a restart.
        """
        self._explain_s, self._discovery_s, self._stale_s = explain_s, discovery_s, stale_s
        self._begun_s: float | None = None
        self._presses = {press.instance: press for press in presses}
        self._reports: dict[Instance, _Report] = {}
        self._newest_s: dict[str, float] = {}  # of any process of that name
        self._unexplained = Arrivals()  # trues without a report
        self._adoptable = Arrivals()  # trues that became unknown, and that a new process may still explain
        self._surely_unknown = _UNKNOWN_PRESS.instance in self._presses
        self._announced = Arrivals()  # reports of a press without its true

    @property
    def presses(self) -> tuple[Press, ...]:
        """Presses that stand, in the order of their beginning."""
        return tuple(self._presses.values())

    def message(self, pressed: bool, now_s: float) -> None:
        """A message of ``/emergency_stop``."""
        self._age(now_s)
        if not pressed:
            return
        if not self._announced.take(1):
            self._unexplained.add(now_s)

    def report(self, report: SourceReport, now_s: float) -> None:
        """A message of ``/emergency_stop/sources``."""
        self._age(now_s)
        last = self._reports.get(report.instance)
        if last is not None:
            self._explain(max(0, report.presses - last.report.presses), now_s)
        else:
            self._meet(report, report.name in self._newest_s, now_s)
        self._remember(report, now_s)
        if not report.pressed:
            self._presses.pop(report.instance, None)
        elif report.instance in self._presses or len(self._presses) < MOST_SOURCES:
            self._presses[report.instance] = Press(*report.instance)
        else:
            self._surely_unknown = True
            self._press_unknown()

    def clear(self, name: str, now_s: float) -> str:
        """Clears the sources of a name that cannot release themselves, for an operator. Returns why not, "" if done."""
        self._age(now_s)
        named = [press for press in self._presses.values() if press.name == name]
        if not named:
            standing = ", ".join(press.name for press in self._presses.values()) or "no source"
            return f"{name!r} is not pressed; pressed: {standing}"
        gone = [press for press in named if not self._is_there(press, now_s)]
        if not gone:
            return f"{name} is running and reports that it is pressed: release it there"
        for press in gone:
            del self._presses[press.instance]
        if name == UNKNOWN:
            self._surely_unknown, self._adoptable = False, Arrivals()
        return ""

    def presence(self, now_s: float) -> dict[str, Presence]:
        """For every name with a standing press, whether its source is present to release it.

        Of several processes of one name, one that is gone decides.
        """
        self._age(now_s)
        found: dict[str, Presence] = {}
        for press in self._presses.values():
            if found.get(press.name) is not Presence.GONE:
                found[press.name] = self._presence(press, now_s)
        return found

    def standing(self, now_s: float) -> str:
        """One phrase with everything that prevents a release; empty if nothing does."""
        self._age(now_s)
        names = [self._label(press, now_s) for press in self._presses.values()]
        parts = [f"pressed by {', '.join(names)}"] if names else []
        if self._unexplained:
            parts.append("a true on /emergency_stop whose source has not reported yet")
        return "; ".join(parts)

    def age_s(self, name: str, now_s: float) -> float:
        """Seconds since the newest report of any process of that name, infinite without one."""
        return age_s(now_s, self._newest_s.get(name))

    def _explain(self, presses: int, now_s: float) -> None:
        """Processes the number of trues that a report adds to the earlier ones."""
        self._announced.add(now_s, presses - self._unexplained.take(presses))

    def _remember(self, report: SourceReport, now_s: float) -> None:
        self._reports[report.instance] = _Report(report, now_s)
        self._newest_s[report.name] = now_s
        if len(self._reports) > MOST_SOURCES:
            del self._reports[min(self._reports, key=lambda instance: self._reports[instance].at_s)]
        if len(self._newest_s) > MOST_SOURCES:
            del self._newest_s[min(self._newest_s, key=lambda name: self._newest_s[name])]

    def _meet(self, report: SourceReport, restarted: bool, now_s: float) -> None:
        """Processes the first report of a process. Its messages may have arrived long before it.

        restarted: another process of this name has reported before.
        """
        begun_after_us = restarted or age_s(now_s, self._begun_s) > self._discovery_s
        # From a process that may be older than this monitor only the retained last message can have arrived.
        presses = report.presses if begun_after_us else int(report.pressed)
        adopted = self._unexplained.take(presses)
        adopted += self._adoptable.take(presses - adopted)
        if not self._adoptable and not self._surely_unknown:
            self._presses.pop(_UNKNOWN_PRESS.instance, None)
        if report.pressed and not adopted:
            self._announced.add(now_s)

    def _label(self, press: Press, now_s: float) -> str:
        return f"{press.name} (gone)" if self._presence(press, now_s) is Presence.GONE else press.name

    def _presence(self, press: Press, now_s: float) -> Presence:
        if press.name == UNKNOWN:
            return Presence.UNKNOWN
        return Presence.THERE if self._is_there(press, now_s) else Presence.GONE

    def _is_there(self, press: Press, now_s: float) -> bool:
        last = self._reports.get(press.instance)
        return last is not None and age_s(now_s, last.at_s) <= self._stale_s

    def _press_unknown(self) -> None:
        self._presses.setdefault(_UNKNOWN_PRESS.instance, _UNKNOWN_PRESS)

    def _age(self, now_s: float) -> None:
        """Trues that have waited too long get an unknown source; reports that have waited too long explain nothing."""
        if self._begun_s is None:
            self._begun_s = now_s
        for at_s, count in self._unexplained.expire(self._explain_s, now_s):
            self._adoptable.add(at_s, count)
            self._press_unknown()
        if self._adoptable.expire(self._discovery_s, now_s):
            self._surely_unknown = True
        self._announced.expire(self._explain_s, now_s)


_UNKNOWN_PRESS = Press(UNKNOWN, 0)


class SourcePresence:
    """Presence of a required source, monitored once it has been present for ``settle_s`` without a break."""

    def __init__(self, silence_s: float, settle_s: float) -> None:
        self._silence_s, self._settle_s = silence_s, settle_s
        self._there_for = Hold()
        self._settled = False

    def missing(self, age_s: float, complete: bool, now_s: float) -> bool:
        """True while the source is missing. Call at every step.

        age_s: of its newest report. complete: every critical process has sent a heartbeat; before that the
        machine is under start-up load.
        """
        there = age_s <= self._silence_s
        there_for_s = self._there_for.update(there and complete, now_s)
        self._settled = self._settled or (there_for_s is not None and there_for_s >= self._settle_s)
        return self._settled and not there

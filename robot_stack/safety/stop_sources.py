"""Who presses the emergency stop, by name.

``/emergency_stop`` is one topic with many publishers and no names. Sources of this stack therefore also report who they
are on ``/emergency_stop/sources``, beside each message there and again and again. What is pressed stays pressed until
the process that pressed says itself that it is released, or until an operator clears it by name. Each true on
``/emergency_stop`` must be explained by a report of one more press; one that nobody explains in time is a press of a
source called ``unknown``. False messages release nothing here: nobody knows whose they are.

Times are steady seconds, given as arguments.
"""

from __future__ import annotations

from dataclasses import dataclass

from robot_stack.core.stop_presence import Presence
from robot_stack.safety.timing import Hold, age_s

UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class SourceReport:
    """One message of ``/emergency_stop/sources``. presses: how often this process has published true so far."""

    name: str
    pid: int
    presses: int
    pressed: bool


@dataclass(frozen=True, slots=True)
class Press:
    """A press that stands. pid: the process that pressed and alone may release it."""

    name: str
    pid: int


@dataclass(frozen=True, slots=True)
class _Heard:
    report: SourceReport
    at_s: float


class StopSources:
    """Matches what is said on ``/emergency_stop`` with who says it."""

    def __init__(self, explain_s: float, discovery_s: float, stale_s: float, presses: tuple[Press, ...] = ()) -> None:
        """explain_s: how far apart a true and the report that explains it may arrive. discovery_s: the same for a
        process of which nothing was heard before: two topics of a new process are not found at the same time. stale_s:
        a source that is silent for longer is gone. presses: those that stood before a restart.
        """
        self._explain_s, self._discovery_s, self._stale_s = explain_s, discovery_s, stale_s
        self._begun_s: float | None = None
        self._presses = {press.name: press for press in presses}
        self._heard: dict[str, _Heard] = {}
        self._unexplained_s: list[float] = []  # arrivals of trues without a report
        self._adoptable_s: list[float] = []  # of those that became unknown, and that a new process may yet explain
        self._surely_unknown = UNKNOWN in self._presses
        self._announced_s: list[float] = []  # arrivals of reports of a press without its true

    @property
    def presses(self) -> tuple[Press, ...]:
        """Presses that stand, in the order of their beginning."""
        return tuple(self._presses.values())

    def message(self, pressed: bool, now_s: float) -> None:
        """A message of ``/emergency_stop``."""
        self._age(now_s)
        if not pressed:
            return
        if self._announced_s:
            self._announced_s.pop(0)
        else:
            self._unexplained_s.append(now_s)

    def report(self, report: SourceReport, now_s: float) -> None:
        """A message of ``/emergency_stop/sources``."""
        self._age(now_s)
        heard = self._heard.get(report.name)
        if heard is not None and heard.report.pid == report.pid:
            self._explain(max(0, report.presses - heard.report.presses), now_s)
        else:
            self._meet(report, heard is not None, now_s)
        self._heard[report.name] = _Heard(report, now_s)
        press = self._presses.get(report.name)
        if report.pressed:
            self._presses[report.name] = Press(report.name, report.pid)
        elif press is not None and press.pid == report.pid:
            del self._presses[report.name]

    def clear(self, name: str, now_s: float) -> str:
        """An operator clears a source that cannot release itself. Returns why not, an empty text if it is done."""
        self._age(now_s)
        press = self._presses.get(name)
        if press is None:
            standing = ", ".join(self._presses) or "no source"
            return f"{name!r} is not pressed; pressed: {standing}"
        if self._is_there(press, now_s):
            return f"{name} is there and says that it is pressed: release it there"
        del self._presses[name]
        if name == UNKNOWN:
            self._surely_unknown, self._adoptable_s = False, []
        return ""

    def presence(self, now_s: float) -> dict[str, Presence]:
        """Of every press that stands, whether its source is there to release it."""
        self._age(now_s)
        return {press.name: self._presence(press, now_s) for press in self._presses.values()}

    def standing(self, now_s: float) -> str:
        """Names whatever stands against a release, one phrase; empty if nothing does."""
        self._age(now_s)
        names = [self._label(press, now_s) for press in self._presses.values()]
        parts = [f"pressed by {', '.join(names)}"] if names else []
        if self._unexplained_s:
            parts.append("a true on /emergency_stop whose source has not reported yet")
        return "; ".join(parts)

    def age_s(self, name: str, now_s: float) -> float:
        """Seconds since the source's newest report, infinite without one."""
        heard = self._heard.get(name)
        return age_s(now_s, None if heard is None else heard.at_s)

    def _explain(self, presses: int, now_s: float) -> None:
        """A report tells of so many trues that no report before it has told of."""
        for _ in range(presses):
            if self._unexplained_s:
                self._unexplained_s.pop(0)
            else:
                self._announced_s.append(now_s)

    def _meet(self, report: SourceReport, restarted: bool, now_s: float) -> None:
        """The first report of a process. Its messages may have been heard long before it.

        restarted: another process of this name was heard before.
        """
        begun_after_us = restarted or age_s(now_s, self._begun_s) > self._discovery_s
        # Of a process that may be older than this monitor only the retained last message can have arrived.
        presses = report.presses if begun_after_us else int(report.pressed)
        adopted = 0
        while adopted < presses and (self._unexplained_s or self._adoptable_s):
            (self._unexplained_s or self._adoptable_s).pop(0)
            adopted += 1
        if not self._adoptable_s and not self._surely_unknown:
            self._presses.pop(UNKNOWN, None)
        if report.pressed and not adopted:
            self._announced_s.append(now_s)

    def _label(self, press: Press, now_s: float) -> str:
        return f"{press.name} (gone)" if self._presence(press, now_s) is Presence.GONE else press.name

    def _presence(self, press: Press, now_s: float) -> Presence:
        if press.name == UNKNOWN:
            return Presence.UNKNOWN
        return Presence.THERE if self._is_there(press, now_s) else Presence.GONE

    def _is_there(self, press: Press, now_s: float) -> bool:
        heard = self._heard.get(press.name)
        return heard is not None and heard.report.pid == press.pid and age_s(now_s, heard.at_s) <= self._stale_s

    def _age(self, now_s: float) -> None:
        """Trues that have waited too long have an unknown author; reports that have waited too long explain nothing."""
        if self._begun_s is None:
            self._begun_s = now_s
        self._unexplained_s, unknown_s = _split(self._unexplained_s, self._explain_s, now_s)
        self._adoptable_s, firm_s = _split([*self._adoptable_s, *unknown_s], self._discovery_s, now_s)
        self._surely_unknown = self._surely_unknown or bool(firm_s)
        if unknown_s:
            self._presses.setdefault(UNKNOWN, Press(UNKNOWN, 0))
        self._announced_s, _ = _split(self._announced_s, self._explain_s, now_s)


def _split(times_s: list[float], longest_s: float, now_s: float) -> tuple[list[float], list[float]]:
    """(times at most ``longest_s`` ago, the others)."""
    late_s = [at_s for at_s in times_s if not age_s(now_s, at_s) <= longest_s]
    return [at_s for at_s in times_s if age_s(now_s, at_s) <= longest_s], late_s


class SourcePresence:
    """Is a source there that must be? Missed only after it has once been there for ``settle_s`` without a break."""

    def __init__(self, silence_s: float, settle_s: float) -> None:
        self._silence_s, self._settle_s = silence_s, settle_s
        self._there_for = Hold()
        self._settled = False

    def missing(self, age_s: float, complete: bool, now_s: float) -> bool:
        """True while it is missed. Ask at every step.

        age_s: of its newest report. complete: every critical process has been heard; before that the machine is busy
        starting.
        """
        there = age_s <= self._silence_s
        there_for_s = self._there_for.update(there and complete, now_s)
        self._settled = self._settled or (there_for_s is not None and there_for_s >= self._settle_s)
        return self._settled and not there

"""Decides when a process is started, counts as hung, is restarted or given up. Pure: time and events in, orders out.

A process is restarted after a back-off that grows with each crash. A process that crashes more than ``max_restarts``
times in a minute, or rejects its configuration, is given up: it stays down, visibly, until an operator restarts it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum

from robot_stack.contract.model import Process
from robot_stack.supervisor.params import SupervisorParams

WINDOW_S = 60.0  # max_restarts of the contract's process rows counts within this time
EXIT_REFUSED = 2  # a mistake in configuration or use: starting again will not help


class State(Enum):
    STARTING = "starting"  # being constructed: its loop does not run yet
    WAITING = "waiting"  # alive, but an input or condition is missing
    READY = "ready"
    HUNG = "hung"  # silent for too long; being ended
    RESTARTING = "restarting"  # ending for an operator's restart
    BACKOFF = "backoff"  # ended; will be started again
    FAILED = "failed"  # given up
    STOPPED = "stopped"  # not to run


class Order(Enum):
    NONE = "none"
    START = "start"
    TERMINATE = "terminate"
    KILL = "kill"


RUNNING = (State.STARTING, State.WAITING, State.READY, State.HUNG, State.RESTARTING)
_ENDING = (State.HUNG, State.RESTARTING)


class Lifecycle:
    """One process. Times are steady seconds."""

    def __init__(self, row: Process, params: SupervisorParams) -> None:
        self._params, self._max_restarts = params, row.max_restarts
        self._backoff = params.backoff[row.criticality]
        self.state = State.STOPPED
        self.reason = ""  # why it is not ready, for people
        self.restarts = 0
        self.last_exit: int | None = None
        self._crashes: deque[float] = deque()
        self._tries = 0  # crashes since it last ran for stable_after_s
        self._started_s = 0.0
        self._heartbeat_s: float | None = None
        self._been_ready = False
        self._starved_s = 0.0
        self._due_s = 0.0  # time of the next start in BACKOFF, of SIGKILL in HUNG

    def heartbeat_age_s(self, now_s: float) -> float | None:
        """Seconds since the last heartbeat of the running process; None if there is none."""
        if self.state not in RUNNING or self._heartbeat_s is None:
            return None
        return now_s - self._heartbeat_s

    def wanted(self, now_s: float) -> None:
        """Requests a start now, with a clean record (first start, or an operator's restart)."""
        self._crashes.clear()
        self._tries = 0
        if self.state in RUNNING:  # the caller interrupts it; it is killed should it not end
            self.state, self.reason, self._due_s = State.RESTARTING, "restart", now_s + self._params.hung_kill_s
        else:
            self.state, self.reason, self._due_s = State.BACKOFF, "about to start", now_s

    def started(self, now_s: float) -> None:
        self.state, self.reason = State.STARTING, "construction"
        self._started_s, self._heartbeat_s, self._been_ready, self._starved_s = now_s, None, False, 0.0

    def constructing(self, text: str) -> None:
        """The process reports the present step of its construction."""
        if self.state is State.STARTING:
            self.reason = text

    def heartbeat(self, now_s: float, ready: bool, waiting_for: str) -> None:
        if self.state not in RUNNING:
            return
        self._heartbeat_s, self._starved_s = now_s, 0.0
        self._been_ready = self._been_ready or ready
        if self.state not in _ENDING:  # it has had its signal, there is no way back
            self.state = State.READY if ready else State.WAITING
            self.reason = "" if ready else waiting_for

    def exited(self, now_s: float, code: int) -> None:
        """The process has ended by itself, or after an order of this class. ``code`` is negative for a signal."""
        self.last_exit = code
        if self.state is State.RESTARTING:
            self.state, self.reason, self._due_s = State.BACKOFF, "about to start", now_s
            return
        if now_s - self._started_s >= self._params.stable_after_s:
            self._tries = 0
        how = f"was ended by signal {-code}" if code < 0 else f"exited with code {code}"
        if self.state is State.HUNG:
            how = self.reason
        if code == EXIT_REFUSED:
            self._give_up("refused to run, see its log")
            return
        self._crashes.append(now_s)
        while self._crashes and now_s - self._crashes[0] > WINDOW_S:
            self._crashes.popleft()
        if len(self._crashes) > self._max_restarts:
            self._give_up(f"{how}, the {len(self._crashes)}th time within {WINDOW_S:.0f} s")
            return
        delay_s = min(self._backoff.longest_s, self._backoff.first_s * self._backoff.factor**self._tries)
        self._tries += 1
        self.state, self.reason = State.BACKOFF, f"{how}; restart in {delay_s:g} s"
        self._due_s = now_s + delay_s

    def stopped(self) -> None:
        """It has been stopped on purpose."""
        self.state, self.reason = State.STOPPED, "stopped"

    def forgive(self, silence_s: float) -> None:
        """Excludes a time without any reception (this computer was suspended) from all timeouts."""
        self._started_s += silence_s
        if self._heartbeat_s is not None:
            self._heartbeat_s += silence_s

    def starved(self, starved_s: float) -> None:
        """Excludes time spent waiting for a processor from the silence: a starved process is not hung."""
        self._starved_s = starved_s

    def silent(self, now_s: float) -> bool:
        """True if the running process has been silent for longer than its timeout.

        Before it has been ready for the first time it may be compiling, loading or connecting, in its
        constructor or in a first callback: then the timeout of the construction applies.
        """
        if self.state not in (State.STARTING, State.WAITING, State.READY):
            return False
        since_s = self._started_s if self._heartbeat_s is None else self._heartbeat_s
        return now_s - since_s - self._starved_s > self._silence_limit_s()

    def _silence_limit_s(self) -> float:
        return self._params.hang_after_s if self._been_ready else self._params.construction_limit_s

    def order(self, now_s: float, judge: bool = True) -> Order:
        """The order for this tick. ``judge`` False: silence does not count at present."""
        if self.state is State.BACKOFF and now_s >= self._due_s:
            if self.last_exit is not None:
                self.restarts += 1
            return Order.START
        if self.state in _ENDING and now_s >= self._due_s:
            self._due_s = now_s + self._params.hung_kill_s  # again, should the kernel be slow
            return Order.KILL
        if judge and self.silent(now_s):
            before = "" if self._been_ready else f"; it was never ready: {self.reason}"
            self.state = State.HUNG
            self.reason = f"hung: no heartbeat for {self._silence_limit_s():g} s{before}"
            self._due_s = now_s + self._params.hung_kill_s
            return Order.TERMINATE
        return Order.NONE

    def _give_up(self, reason: str) -> None:
        self.state, self.reason = State.FAILED, f"given up: {reason}"


def judged(silent: dict[str, bool]) -> frozenset[str]:
    """Processes whose silence counts. silent: running process -> True if silent.

    If all are silent at once, none hangs: this computer was suspended.
    """
    return frozenset() if len(silent) > 1 and all(silent.values()) else frozenset(silent)


@dataclass(frozen=True, slots=True)
class StartQueue:
    """Queue of first starts: starting all processes at once starves each of them.

    at_once: largest number of processes before their first heartbeat.
    clock_sources: processes that publish the time of a simulated world. No process becomes ready without them, so these
    do not wait.
    """

    at_once: int
    clock_sources: frozenset[str]

    def holds(self, name: str, life: Lifecycle, starting: int) -> bool:
        """starting: processes on their way now."""
        first = life.state is State.BACKOFF and life.last_exit is None
        return first and starting >= self.at_once and name not in self.clock_sources

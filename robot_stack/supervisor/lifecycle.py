"""When one process is started, judged hung, restarted or given up. Pure: time and events in, orders out.

A process is restarted after a waiting time that grows with each crash. Who crashes more than ``max_restarts`` times in
a minute, or refuses its configuration, is given up: it stays down, visibly, until an operator asks for it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum

WINDOW_S = 60.0  # max_restarts of the contract's process rows counts within this time
EXIT_REFUSED = 2  # a mistake in configuration or use: starting again will not help


class State(Enum):
    STARTING = "starting"  # no heartbeat yet
    WAITING = "waiting"  # alive, but an input or condition is missing
    READY = "ready"
    HUNG = "hung"  # silent for too long; being ended
    RESTARTING = "restarting"  # being ended because an operator wants it anew
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


@dataclass(frozen=True, slots=True)
class Limits:
    """The rules for one process; see SupervisorParams for the meaning of each. All but max_restarts in seconds."""

    hang_after_s: float
    start_limit_s: float
    stable_after_s: float
    hung_kill_s: float
    backoff_first_s: float
    backoff_factor: float
    backoff_longest_s: float
    max_restarts: int


class Lifecycle:
    """One process. Times are steady seconds."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self.state = State.STOPPED
        self.reason = ""  # why it is not ready, for people
        self.restarts = 0
        self.last_exit: int | None = None
        self._crashes: deque[float] = deque()
        self._tries = 0  # crashes since it last ran for stable_after_s
        self._started_s = 0.0
        self._heard_s: float | None = None
        self._due_s = 0.0  # time of the next start in BACKOFF, of SIGKILL in HUNG

    def heartbeat_age_s(self, now_s: float) -> float | None:
        """Seconds since the last heartbeat of the running process; None if there is none."""
        if self.state not in RUNNING or self._heard_s is None:
            return None
        return now_s - self._heard_s

    def wanted(self, now_s: float) -> None:
        """Asks for a start now, with a clean record (first start, or an operator's restart)."""
        self._crashes.clear()
        self._tries = 0
        if self.state in RUNNING:  # the caller interrupts it; it is killed should it not end
            self.state, self.reason, self._due_s = State.RESTARTING, "restart", now_s + self._limits.hung_kill_s
        else:
            self.state, self.reason, self._due_s = State.BACKOFF, "about to start", now_s

    def started(self, now_s: float) -> None:
        self.state, self.reason = State.STARTING, "no heartbeat yet"
        self._started_s, self._heard_s = now_s, None

    def heartbeat(self, now_s: float, ready: bool, waiting_for: str) -> None:
        if self.state not in RUNNING:
            return
        self._heard_s = now_s
        if self.state not in _ENDING:  # it has had its signal, there is no way back
            self.state = State.READY if ready else State.WAITING
            self.reason = "" if ready else waiting_for

    def exited(self, now_s: float, code: int) -> None:
        """The process has ended by itself, or after an order of this class. ``code`` is negative for a signal."""
        self.last_exit = code
        if self.state is State.RESTARTING:
            self.state, self.reason, self._due_s = State.BACKOFF, "about to start", now_s
            return
        if now_s - self._started_s >= self._limits.stable_after_s:
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
        if len(self._crashes) > self._limits.max_restarts:
            self._give_up(f"{how}, the {len(self._crashes)}th time within {WINDOW_S:.0f} s")
            return
        delay_s = min(
            self._limits.backoff_longest_s,
            self._limits.backoff_first_s * self._limits.backoff_factor**self._tries,
        )
        self._tries += 1
        self.state, self.reason = State.BACKOFF, f"{how}; restart in {delay_s:g} s"
        self._due_s = now_s + delay_s

    def stopped(self) -> None:
        """It has been stopped on purpose."""
        self.state, self.reason = State.STOPPED, "stopped"

    def forgive(self, silence_s: float) -> None:
        """Takes a time in which nobody could be heard (this computer slept) out of the judgement."""
        self._started_s += silence_s
        if self._heard_s is not None:
            self._heard_s += silence_s

    def silent(self, now_s: float) -> bool:
        """True if the running process has not spoken for longer than it may."""
        if self.state not in (State.STARTING, State.WAITING, State.READY):
            return False
        if self._heard_s is None:
            return now_s - self._started_s > self._limits.start_limit_s
        return now_s - self._heard_s > self._limits.hang_after_s

    def order(self, now_s: float, judge: bool = True) -> Order:
        """What to do now. ``judge`` False: silence is not held against the process at the moment."""
        if self.state is State.BACKOFF and now_s >= self._due_s:
            if self.last_exit is not None:
                self.restarts += 1
            return Order.START
        if self.state in _ENDING and now_s >= self._due_s:
            self._due_s = now_s + self._limits.hung_kill_s  # again, should the kernel be slow
            return Order.KILL
        if judge and self.silent(now_s):
            never = self._heard_s is None
            self.state = State.HUNG
            self.reason = (
                f"no heartbeat within {self._limits.start_limit_s:g} s of its start"
                if never
                else f"hung: no heartbeat for {self._limits.hang_after_s:g} s"
            )
            self._due_s = now_s + self._limits.hung_kill_s
            return Order.TERMINATE
        return Order.NONE

    def _give_up(self, reason: str) -> None:
        self.state, self.reason = State.FAILED, f"given up: {reason}"


@dataclass(frozen=True, slots=True)
class Hearing:
    """Whether silence may be held against the processes, by who is silent.

    If everybody falls silent at once, it is not everybody who hangs: the supervisor does not hear, or time itself
    (/clock) stands still. In simulated time only the world that publishes /clock is judged then.
    """

    clock_sources: frozenset[str]  # processes that publish /clock, where nodes live on it; else empty

    def judged(self, running: dict[str, bool]) -> frozenset[str]:
        """running: process -> is it silent. Returns the processes whose silence counts."""
        if self.clock_sources and any(running.get(name, True) for name in self.clock_sources):
            return self.clock_sources & running.keys()
        if len(running) > 1 and all(running.values()):
            return frozenset()
        return frozenset(running)


@dataclass(frozen=True, slots=True)
class StartQueue:
    """Who waits with its first start: all at once take the processor from each other until some look hung.

    at_once: so many may be on their way to their first heartbeat.
    clock_sources: as in ``Hearing``. Without a clock nobody's heart beats, so these wait for nobody.
    """

    at_once: int
    clock_sources: frozenset[str]

    def holds(self, name: str, life: Lifecycle, starting: int) -> bool:
        """starting: processes on their way now."""
        first = life.state is State.BACKOFF and life.last_exit is None
        return first and starting >= self.at_once and name not in self.clock_sources

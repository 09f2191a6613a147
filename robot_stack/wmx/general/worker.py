"""The thread that owns the engine: no callback waits for an engine that is slow, starts or hangs.

Orders run at once and in their order, between the ticks. A job is a generator: it sends its requests, yields while it
waits for the drives, and returns its response. It continues at every tick, so that a long job blocks no other.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass

from robot_stack.wmx.general.answers import Answer

Job = Generator[None, None, Answer]
Order = Callable[[], None]


@dataclass(slots=True)
class _Running:
    job: Job
    done: Callable[[Answer], None]


def next_deadline(due_s: float, period_s: float, now_s: float) -> float:
    """The deadline after ``due_s``; if several have passed, the last of them: missed ticks are skipped."""
    missed = (now_s - due_s) // period_s
    return due_s + period_s * max(1.0, missed)


class EngineWorker:
    """``tick`` is called once per period on absolute deadlines, ``close`` at the end; both in the thread."""

    def __init__(self, period_s: float, tick: Callable[[], None], close: Callable[[], None]) -> None:
        self.failure: BaseException | None = None
        self._period_s = period_s
        self._tick, self._close = tick, close
        self._orders: deque[Order] = deque()
        self._jobs: list[_Running] = []
        self._wake = threading.Condition()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="engine", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def order(self, order: Order, *, urgent: bool = False) -> None:
        """Queues an order, an urgent one before all others. From any thread; does not wait."""
        with self._wake:
            if urgent:
                self._orders.appendleft(order)
            else:
                self._orders.append(order)
            self._wake.notify()

    def ask(self, job: Callable[[], Job], done: Callable[[Answer], None]) -> None:
        """Starts a job; ``done`` is called with its answer, in the thread."""
        self.order(lambda: self._begin(_Running(job(), done)))

    def end(self, timeout_s: float) -> None:
        """Ends the thread after its present call and ``close``; stops waiting after ``timeout_s``."""
        with self._wake:
            self._end.set()
            self._wake.notify()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def _run(self) -> None:
        try:
            due_s = time.monotonic()
            while not self._end.is_set():
                self._follow_orders(due_s)
                if self._end.is_set():
                    break
                self._tick()
                self._jobs = [running for running in self._jobs if self._goes_on(running)]
                due_s = next_deadline(due_s, self._period_s, time.monotonic())
        except BaseException as error:
            self.failure = error
        finally:
            self._close()

    def _follow_orders(self, due_s: float) -> None:
        while True:
            with self._wake:
                if not self._orders and not self._end.is_set():
                    self._wake.wait(max(0.0, due_s - time.monotonic()))
                order = self._orders.popleft() if self._orders else None
            if self._end.is_set():
                return
            if order is not None:
                order()
            if time.monotonic() >= due_s:  # many orders must not starve the tick
                return

    def _begin(self, running: _Running) -> None:
        if self._goes_on(running):
            self._jobs.append(running)

    def _goes_on(self, running: _Running) -> bool:
        try:
            next(running.job)
        except StopIteration as end:
            running.done(end.value)
            return False
        return True

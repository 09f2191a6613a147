"""Jobs beside a node's loop, whose results arrive after a simulated duration."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor, Future, wait
from typing import Any, TypeVar

from sim.scheduler.parts import SimPort
from sim.scheduler.streams import Delays

T = TypeVar("T")


class SimWorker:
    """See ``robot_stack.middleware.port.Worker``. One job after the other, each for a time from ``delays``.

    pool: where a job runs until its result is due; None: at once, in ``submit``. The results are the same.
    """

    def __init__(self, port: SimPort, delays: Delays, pool: Executor | None) -> None:
        self._port, self._delays, self._pool = port, delays, pool
        self._free_ns = 0
        self._closed = False
        self._running: deque[Future[Any]] = deque()

    def submit(self, job: Callable[[], T], done: Callable[[T], None]) -> None:
        """A job of a process that has ended is dropped; one of a hung process takes as much longer."""
        life = self._port.life
        if self._closed or not life.alive:
            return
        begin_ns = max(life.leaves_ns(), self._free_ns)
        self._free_ns = begin_ns + self._delays.draw()
        result = self._start(job)
        life.events.push(self._free_ns, self._port.order, self._finish, result, done, life.hung_ns)

    def close(self, timeout_s: float) -> None:
        """Accepts no more jobs. Submitted jobs have run; their results still arrive if the node continues."""
        self._closed = True
        self.join()

    def join(self) -> None:
        """Waits for jobs that run in threads, so that their side effects are as if they had run at once."""
        wait(self._running)
        self._running.clear()

    def _start(self, job: Callable[[], T]) -> Future[T]:
        if self._pool is None:
            result: Future[T] = Future()
            try:
                result.set_result(job())
            except Exception as error:
                result.set_exception(error)
            return result
        before = self._running[-1] if self._running else None
        future = self._pool.submit(_after, before, job)
        self._running.append(future)
        return future

    def _finish(self, result: Future[T], done: Callable[[T], None], hung_ns: int) -> None:
        life = self._port.life
        if not life.alive:
            return
        if life.hung_ns > hung_ns:
            # The process stood still meanwhile, and so did its threads.
            later_ns = life.events.now_ns + life.hung_ns - hung_ns
            self._free_ns = max(self._free_ns, later_ns)
            life.events.push(later_ns, self._port.order, self._finish, result, done, life.hung_ns)
            return
        if self._running and self._running[0] is result:
            self._running.popleft()
        # An exception of a job is raised in the loop: a worker must not end unnoticed.
        self._port.call_soon(lambda: done(result.result()))


def _after(before: Future[Any] | None, job: Callable[[], T]) -> T:
    # The pool starts jobs in the order of submission: the one before runs already and cannot wait for this one.
    if before is not None:
        wait([before])
    return job()

"""A worker whose jobs run on the test's command, for work beside a node's loop."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")


class SteppedWorker:
    """See ``robot_stack.core.worker.Worker``. ``start`` runs a job, ``deliver`` passes its result to the loop."""

    def __init__(self) -> None:
        self.closed = False
        self.running: Callable[[], None] | None = None
        self._queue: deque[tuple[Callable[[], Any], Callable[[Any], None]]] = deque()

    @property
    def busy(self) -> bool:
        return bool(self._queue) or self.running is not None

    def submit(self, job: Callable[[], T], done: Callable[[T], None]) -> None:
        assert not self.closed
        self._queue.append((job, done))

    def start(self) -> None:
        assert self.running is None
        job, done = self._queue.popleft()
        result = job()
        self.running = lambda: done(result)

    def deliver(self) -> None:
        deliver, self.running = self.running, None
        assert deliver is not None
        deliver()

    def step(self) -> None:
        self.start()
        self.deliver()

    def finish(self) -> None:
        """Runs all jobs, and the jobs that their results submit."""
        while self._queue:
            self.step()

    def close(self, timeout_s: float) -> None:
        """A closed loop accepts no results."""
        assert timeout_s > 0.0
        self.closed = True
        while self._queue:
            job, _ = self._queue.popleft()
            job()

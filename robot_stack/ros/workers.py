"""Jobs beside a node's loop: a thread per worker. Compiled loops release the interpreter lock."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")


class ThreadWorker:
    """See ``robot_stack.middleware.port.Worker``. in_loop: calls a function once in the node's loop."""

    def __init__(self, name: str, in_loop: Callable[[Callable[[], None]], None]) -> None:
        self._in_loop = in_loop
        self._wake = threading.Condition()
        self._jobs: deque[tuple[Callable[[], Any], Callable[[Any], None]]] = deque()
        self._unfinished = 0
        self._closed = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def busy(self) -> bool:
        """True while a job is queued or running, or its result has not reached the loop yet."""
        return self._unfinished > 0

    def submit(self, job: Callable[[], T], done: Callable[[T], None]) -> None:
        with self._wake:
            self._jobs.append((job, done))
            self._unfinished += 1
            self._wake.notify()

    def close(self, timeout_s: float) -> None:
        with self._wake:
            self._closed = True
            self._wake.notify()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._jobs or self._closed)
                if not self._jobs:
                    return
                job, done = self._jobs.popleft()
            self._hand_over(done, job())

    def _hand_over(self, done: Callable[[Any], None], result: Any) -> None:
        def deliver() -> None:
            with self._wake:
                self._unfinished -= 1
            done(result)

        self._in_loop(deliver)

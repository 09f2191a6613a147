"""Hands work from other threads to the loop that owns the simulation: nothing changes in the middle of a step."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

ResultT = TypeVar("ResultT")


class NotServed(Exception):
    """The loop did not serve the request in time."""


class _Request(Generic[ResultT]):
    def __init__(self, work: Callable[[], ResultT]) -> None:
        self._work = work
        self._done = threading.Event()
        self._result: ResultT | None = None
        self._error: Exception | None = None

    def run(self) -> None:
        try:
            self._result = self._work()
        except Exception as error:  # raised in the requesting thread, not in the loop
            self._error = error
        self._done.set()

    def wait(self, timeout_s: float) -> ResultT:
        if not self._done.wait(timeout_s):
            raise NotServed(f"the simulation did not answer within {timeout_s} s")
        if self._error is not None:
            raise self._error
        return self._result  # type: ignore[return-value]  # set by run() unless it raised


class RequestQueue:
    """``ask`` from any thread, ``serve`` from the loop."""

    def __init__(self) -> None:
        self._waiting: deque[_Request[object]] = deque()

    def ask(self, work: Callable[[], ResultT], timeout_s: float) -> ResultT:
        """The result of ``work`` done by the loop, or its exception. Raises NotServed if the loop stalls."""
        request = _Request(work)
        self._waiting.append(request)  # type: ignore[arg-type]  # the loop does not look at results
        return request.wait(timeout_s)

    def serve(self) -> None:
        """Executes pending requests; nearly free without any."""
        while self._waiting:
            self._waiting.popleft().run()

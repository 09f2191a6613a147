"""A thread that matches sweeps, so that a search of seconds delays no pose: kernels release the interpreter lock."""

from __future__ import annotations

import threading
from collections.abc import Callable

from robot_stack.localization.ndt.solver import MatchRequest, MatchResult, SweepSolver


class MatchingThread:
    """One question at a time; ``done`` is called in the thread when there is an answer to take."""

    def __init__(self, solver: SweepSolver, done: Callable[[], None]) -> None:
        self._solver = solver
        self._done = done
        self._request: MatchRequest | None = None
        self._answer: MatchResult | None = None
        self._wake = threading.Condition()
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="matching", daemon=True)
        self._thread.start()

    def busy(self) -> bool:
        """True from a question until its answer was taken."""
        with self._wake:
            return self._request is not None or self._answer is not None

    def ask(self, request: MatchRequest) -> None:
        with self._wake:
            self._request = request
            self._wake.notify()

    def take(self) -> MatchResult | None:
        with self._wake:
            answer, self._answer = self._answer, None
            return answer

    def end(self) -> None:
        """Returns when the thread has ended, at the latest after the match it is at or two seconds."""
        with self._wake:
            self._ended = True
            self._wake.notify()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._request is not None or self._ended)
                request = self._request
            if self._ended or request is None:
                return
            answer = self._solve(request)
            with self._wake:
                self._request, self._answer = None, answer
            self._done()

    def _solve(self, request: MatchRequest) -> MatchResult:
        try:
            return self._solver.solve(request)
        except Exception as error:  # a sweep that cannot be matched must not end the thread: the quality tells
            return MatchResult(request, None, 0, f"matching failed: {type(error).__name__}: {error}")

"""A thread that plans routes, so that a search of a second delays no command: kernels release the interpreter lock."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

from robot_stack.navigation.routes import RouteRequest, RouteResult, RouteSolver
from robot_stack.navigation.stop import Stop


class PlanningThread:
    """``RoutePlanner`` in a thread. done: called in it whenever it has nothing more to do."""

    def __init__(self, solver: RouteSolver, done: Callable[[], None]) -> None:
        self._solver = solver
        self._done = done
        self._next: RouteRequest | None = None
        self._answer: RouteResult | None = None
        self._stop: Stop | None = None
        self._wake = threading.Condition()
        self._ended = False
        self._busy_since_s = math.inf
        self._thread = threading.Thread(target=self._run, name="planning", daemon=True)
        self._thread.start()

    def ask(self, question: RouteRequest) -> None:
        with self._wake:
            self._forget()
            self._next = question
            self._wake.notify()

    def take(self) -> RouteResult | None:
        with self._wake:
            answer, self._answer = self._answer, None
            return answer

    def drop(self) -> None:
        with self._wake:
            self._forget()

    def busy(self) -> bool:
        """True from a question until it is answered or no longer wanted."""
        with self._wake:
            return self._next is not None or (self._stop is not None and not self._stop.wanted)

    def busy_since_s(self, now_s: float) -> float:
        """When it was first seen busy by who asks this again and again; infinite while it is not."""
        self._busy_since_s = min(self._busy_since_s, now_s) if self.busy() else math.inf
        return self._busy_since_s

    def end(self) -> None:
        """Returns when the thread has ended, at the latest after two seconds."""
        with self._wake:
            self._forget()
            self._ended = True
            self._wake.notify()
        self._thread.join(timeout=2.0)

    def _forget(self) -> None:
        self._next = self._answer = None
        if self._stop is not None:
            self._stop.set()

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._next is not None or self._ended)
                if self._ended or self._next is None:
                    return
                question, self._next = self._next, None
                self._stop = stop = Stop()
            answer = self._solve(question, stop)
            with self._wake:
                self._stop = None
                if not stop.wanted:
                    self._answer = answer
            self._done()

    def _solve(self, question: RouteRequest, stop: Stop) -> RouteResult:
        try:
            return self._solver.solve(question, stop)
        except Exception as error:  # the robot waits for a route as without a way, and the text tells why
            return RouteResult(None, f"planning failed: {type(error).__name__}: {error}")

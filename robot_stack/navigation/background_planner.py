"""Route planning in a worker, so that a search of a second delays no command."""

from __future__ import annotations

from robot_stack.core.worker import Worker
from robot_stack.navigation.cancel_flag import CancelFlag
from robot_stack.navigation.routes import RouteRequest, RouteResult, RouteSolver


class BackgroundPlanner:
    """``RoutePlanner`` on a worker. A newer request cancels the one before."""

    def __init__(self, solver: RouteSolver, worker: Worker) -> None:
        self._solver = solver
        self._worker = worker
        self._answer: RouteResult | None = None
        self._stop: CancelFlag | None = None

    def ask(self, question: RouteRequest) -> None:
        self.drop()
        stop = self._stop = CancelFlag()
        self._worker.submit(lambda: self._solve(question, stop), lambda answer: self._keep(answer, stop))

    def take(self) -> RouteResult | None:
        answer, self._answer = self._answer, None
        return answer

    def drop(self) -> None:
        self._answer = None
        if self._stop is not None:
            self._stop.set()
            self._stop = None

    def busy(self) -> bool:
        """True from a request until it is answered or dropped."""
        return self._stop is not None

    def close(self, timeout_s: float) -> None:
        """Cancels the request under way and ends the worker."""
        self.drop()
        self._worker.close(timeout_s)

    def _solve(self, question: RouteRequest, stop: CancelFlag) -> RouteResult:
        if stop.is_set:
            return RouteResult(None, "cancelled")
        try:
            return self._solver.solve(question, stop)
        except Exception as error:  # handled like a missing route; the reason has the error
            return RouteResult(None, f"planning failed: {type(error).__name__}: {error}")

    def _keep(self, answer: RouteResult, stop: CancelFlag) -> None:
        if stop is self._stop:
            self._answer, self._stop = answer, None

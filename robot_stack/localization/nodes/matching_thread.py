"""A thread that matches sweeps, so that a search of seconds delays no pose: kernels release the interpreter lock."""

from __future__ import annotations

import threading

from robot_stack.localization.ndt.solver import Answer, Question, SweepSolver, warm_up


class MatchingThread:
    """One question at a time; who asks comes back for the answer."""

    def __init__(self, solver: SweepSolver) -> None:
        self._solver = solver
        self._question: Question | None = None
        self._answer: Answer | None = None
        self._wake = threading.Condition()
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="matching", daemon=True)
        self._thread.start()

    def busy(self) -> bool:
        """True from a question until its answer was taken."""
        with self._wake:
            return self._question is not None or self._answer is not None

    def ask(self, question: Question) -> None:
        with self._wake:
            self._question = question
            self._wake.notify()

    def take(self) -> Answer | None:
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
        warm_up()
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._question is not None or self._ended)
                question = self._question
            if self._ended or question is None:
                return
            answer = self._solve(question)
            with self._wake:
                self._question, self._answer = None, answer

    def _solve(self, question: Question) -> Answer:
        try:
            return self._solver.solve(question)
        except Exception as error:  # a sweep that cannot be matched must not end the thread: the quality tells
            return Answer(question, None, 0, f"matching failed: {type(error).__name__}: {error}")

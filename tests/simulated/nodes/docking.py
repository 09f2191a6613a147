"""A docking controller for tests on the scheduler: actions that succeed, fail, are rejected, hang, or end slowly."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any

from std_msgs.msg import Bool

from custom_msgs.action import Dock, Undock
from custom_msgs.msg import DockingStatus
from robot_stack.contract import actions, topics
from robot_stack.contract.model import Action
from robot_stack.middleware.port import Port
from sim.scheduler.actions import SimActionServer
from tests.simulated.bench import Bench

_POLL_S = 0.01


class _Server(SimActionServer):
    """A server that may reject goals, and that may lose goals and answers."""

    def __init__(self, docking: FakeDocking, port: Any, row: Action, on_goal: Callable[[Any], None]) -> None:
        self._docking = docking
        super().__init__(docking.bench.scheduler.calls, port, row.type, row.name, on_goal)

    def _on_send_goal(self, request: Any, answer: Callable[[Any], None], client: Any) -> None:
        docking = self._docking
        if docking.loses_goals:
            return
        if docking.rejects:
            answer(False)
            return
        super()._on_send_goal(request, (lambda _: None) if docking.loses_answers else answer, client)


class FakeDocking:
    """Attributes determine the behaviour for the next goals; ``goals`` records the requested goals.

    loses_goals, loses_answers: requests, or their answers, never arrive. rejects: goals are refused. hangs: a goal runs
    until it is cancelled. cancel_s: how long a cancelled goal takes to end. error: (code, reason) of a failure, None
    for success. steps: states of the feedback before the end, each for step_s.
    """

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.rejects = self.hangs = self.loses_goals = self.loses_answers = False
        self.cancel_s = 0.0
        self.error: tuple[int, str] | None = None
        self.steps: tuple[str, ...] = ("SERVOING", "FINE_ALIGN")
        self.step_s = 0.15
        self.goals: list[tuple[str, str]] = []
        self.cancelled = 0
        self.process = bench.peer("docking_controller", self._build).process

    def _build(self, port: Port) -> None:
        self._state = "IDLE"
        self._jobs: list[Generator[None]] = []
        self._passenger = port.advertise(topics.PASSENGER_ATTACHED, topics.PASSENGER_ATTACHED.name)
        status = port.advertise(topics.DOCKING_STATUS, topics.DOCKING_STATUS.name)
        port.add_timer(0.1, lambda: status.publish(DockingStatus(state=self._state)))
        port.add_timer(_POLL_S, self._go_on)
        _Server(self, port, actions.DOCK, lambda goal: self._begin(goal, Dock))
        _Server(self, port, actions.UNDOCK, lambda goal: self._begin(goal, Undock))

    def _begin(self, goal: Any, action: Any) -> None:
        self.goals.append((action.__name__.lower(), goal.request.dock_id))
        self._jobs.append(self._execute(goal, action))

    def _go_on(self) -> None:
        self._jobs = [job for job in self._jobs if next(job, self) is None]

    def _execute(self, goal: Any, action: Any) -> Generator[None]:
        for state in self.steps:
            self._state = state if action is Dock else "DOCKED"
            goal.publish_feedback(action.Feedback(state=state))
            yield from self._wait(self.step_s, goal)
        while self.hangs and not goal.is_cancel_requested:
            yield
        self._state = "IDLE"
        if goal.is_cancel_requested:
            self.cancelled += 1
            yield from self._wait(self.cancel_s)
            goal.cancel(action.Result(error_code=action.Result.CANCELED, reason="cancelled"))
        elif self.error is not None:
            goal.abort(action.Result(error_code=self.error[0], reason=self.error[1]))
        else:
            self._passenger.publish(Bool(data=action is Dock))
            goal.succeed(action.Result(success=True))

    def _wait(self, seconds: float, goal: Any = None) -> Generator[None]:
        """Waits, but ends early if the goal is cancelled."""
        end_s = self.bench.now_s + seconds
        while self.bench.now_s < end_s and not (goal is not None and goal.is_cancel_requested):
            yield

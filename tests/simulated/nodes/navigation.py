"""A navigation controller for tests on the scheduler: its goals run until they are cancelled, preempted or ended."""

from __future__ import annotations

from typing import Any

from nav2_msgs.action import NavigateToPose
from robot_stack.contract import actions
from robot_stack.middleware.port import ActionGoal, Port
from sim.scheduler.actions import SimActionServer
from tests.simulated.bench import Bench

_FEEDBACK_S = 0.2


class FakeNavigation:
    """goals: the poses requested, with the times. ended: status of each goal that has ended, in order."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.goals: list[tuple[float, Any]] = []
        self.ended: list[str] = []
        self.goal: ActionGoal | None = None
        self.process = bench.peer("navigation_controller", self._build).process

    def _build(self, port: Port) -> None:
        self.goal = None
        row = actions.NAVIGATE_TO_POSE
        SimActionServer(self.bench.scheduler.calls, port, row.type, row.name, self._on_goal)  # type: ignore[arg-type]
        port.add_timer(_FEEDBACK_S, self._on_timer)

    def _on_goal(self, goal: ActionGoal) -> None:
        self.goals.append((self.bench.now_s, goal.request.pose))
        self.end()
        self.goal = goal

    def _on_timer(self) -> None:
        if self.goal is not None:
            self.goal.publish_feedback(NavigateToPose.Feedback())
            if self.goal.is_cancel_requested:
                self.end()

    def end(self, code: int = 0, reason: str = "preempted") -> None:
        """Ends the goal: cancelled if that was requested, else aborted."""
        goal, self.goal = self.goal, None
        if goal is None:
            return
        result = NavigateToPose.Result(error_code=code, error_msg=reason)
        self.ended.append("canceled" if goal.is_cancel_requested else "aborted")
        goal.cancel(result) if goal.is_cancel_requested else goal.abort(result)

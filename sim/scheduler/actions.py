"""Actions of the simulated port: three calls and the feedback, as in ROS 2."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any

from robot_stack.contract.model import Action
from robot_stack.core.goals import GoalStatus
from robot_stack.middleware.conversions import NANOSECONDS
from robot_stack.middleware.interfaces import interface_class
from robot_stack.middleware.port import ActionGoal, CancelAnswer
from robot_stack.ros.serialization import deserialize_message, serialize_message
from sim.scheduler.calls import Calls
from sim.scheduler.parts import SimPort

_GOAL, _RESULT, _CANCEL, _CANCEL_ALL, _FEEDBACK = (
    f"/_action/{name}" for name in ("send_goal", "get_result", "cancel_goal", "cancel_all", "feedback")
)
Answer = Callable[[Any], None]
Ended = tuple[GoalStatus, bytes]


class SimGoal:
    """See ``robot_stack.middleware.port.ActionGoal``."""

    def __init__(self, goal_id: bytes, request: Any, accepted_ns: int, send_feedback: Callable[[Any], None]) -> None:
        self.goal_id = goal_id
        self.request = request
        self.accepted_ns = accepted_ns
        self.is_cancel_requested = False
        self.ended: Ended | None = None
        self.waiting: list[Answer] = []
        self._send_feedback = send_feedback

    @property
    def is_active(self) -> bool:
        return self.ended is None

    def publish_feedback(self, feedback: Any) -> None:
        self._send_feedback(feedback)

    def succeed(self, result: Any) -> None:
        self._end(GoalStatus.SUCCEEDED, result)

    def abort(self, result: Any) -> None:
        self._end(GoalStatus.ABORTED, result)

    def cancel(self, result: Any) -> None:
        """Raises RuntimeError unless the cancellation was requested, as rclpy does."""
        if not self.is_cancel_requested:
            raise RuntimeError("a goal can be cancelled only after a request to cancel it")
        self._end(GoalStatus.CANCELED, result)

    def _end(self, status: GoalStatus, result: Any) -> None:
        if self.ended is not None:
            raise RuntimeError(f"the goal has ended already: {self.ended[0].name}")
        self.ended = status, bytes(serialize_message(result))
        waiting, self.waiting = self.waiting, []
        for answer in waiting:
            answer(self.ended)


class SimActionServer:
    """Accepts every goal and every request to cancel. Goals that ended stay known as long as the node lives."""

    def __init__(
        self, calls: Calls, port: SimPort, type_name: str, name: str, on_goal: Callable[[ActionGoal], None]
    ) -> None:
        self._calls, self._port, self._name = calls, port, name
        self._action = interface_class(type_name)
        self._on_goal = on_goal
        self._goals: dict[bytes, SimGoal] = {}
        self._unknown: Ended = GoalStatus.UNKNOWN, bytes(serialize_message(self._action.Result()))
        calls.serve(port, name + _GOAL, self._on_send_goal)
        calls.serve(port, name + _RESULT, self._on_get_result)
        calls.serve(port, name + _CANCEL, self._on_cancel)
        calls.serve(port, name + _CANCEL_ALL, self._on_cancel_all)

    def _on_send_goal(
        self, request: tuple[bytes, bytes, Callable[[bytes], None]], answer: Answer, client: SimPort
    ) -> None:
        goal_id, data, on_feedback = request
        if goal_id in self._goals:  # a duplicate
            answer(False)
            return

        def send_feedback(feedback: Any) -> None:
            message = bytes(serialize_message(feedback))
            self._calls.send(self._port, self._name + _FEEDBACK, client, lambda: on_feedback(message))

        goal = SimGoal(goal_id, deserialize_message(data, self._action.Goal), self._port.now_ns(), send_feedback)
        self._goals[goal_id] = goal
        answer(True)
        self._on_goal(goal)

    def _on_get_result(self, goal_id: bytes, answer: Answer, _: SimPort) -> None:
        goal = self._goals.get(goal_id)
        if goal is None:
            answer(self._unknown)
        elif goal.ended is not None:
            answer(goal.ended)
        else:
            goal.waiting.append(answer)

    def _on_cancel(self, goal_id: bytes, answer: Answer, _: SimPort) -> None:
        goal = self._goals.get(goal_id)
        if goal is None:
            answer(CancelAnswer.UNKNOWN_GOAL)
        elif not goal.is_active:
            answer(CancelAnswer.ALREADY_ENDED)
        else:
            goal.is_cancel_requested = True
            answer(CancelAnswer.ACCEPTED)

    def _on_cancel_all(self, before_ns: int, answer: Answer, _: SimPort) -> None:
        for goal in self._goals.values():
            if goal.is_active and goal.accepted_ns <= before_ns:
                goal.is_cancel_requested = True
        answer(CancelAnswer.ACCEPTED)


class SimActionClient:
    """See ``robot_stack.middleware.port.ActionClient``."""

    def __init__(self, calls: Calls, port: SimPort, row: Action) -> None:
        self._calls, self._port, self._name = calls, port, row.name
        self._action = interface_class(row.type)

    def server_is_ready(self) -> bool:
        return all(self._calls.ready(self._name + part) for part in (_GOAL, _RESULT, _CANCEL))

    def send_goal(
        self, request: Any, accepted: Callable[[bool], None], feedback: Callable[[Any], None]
    ) -> SimClientGoal:
        def on_feedback(data: bytes) -> None:
            feedback(deserialize_message(data, self._action.Feedback))

        # Numbered, not drawn: an identifier must not depend on what else is drawn. A node may have several clients.
        text = f"{self._port.name}/{self._port.process_id}{self._name}/{self._calls.next_goal()}"
        goal_id = hashlib.sha256(text.encode()).digest()[:16]
        message = goal_id, bytes(serialize_message(request)), on_feedback
        self._calls.call(self._port, self._name + _GOAL, message, accepted)
        return SimClientGoal(self._calls, self._port, self._name, self._action, goal_id)

    def cancel_all(self, before: Any) -> None:
        before_ns = before.sec * NANOSECONDS + before.nanosec
        self._calls.call(self._port, self._name + _CANCEL_ALL, before_ns, lambda _: None)


class SimClientGoal:
    """See ``robot_stack.middleware.port.ClientGoal``."""

    def __init__(self, calls: Calls, port: SimPort, name: str, action: Any, goal_id: bytes) -> None:
        self._calls, self._port, self._name, self._action = calls, port, name, action
        self.goal_id = goal_id

    def ask_result(self, done: Callable[[GoalStatus, Any], None]) -> None:
        def on_answer(ended: Ended) -> None:
            status, data = ended
            done(status, deserialize_message(data, self._action.Result))

        self._calls.call(self._port, self._name + _RESULT, self.goal_id, on_answer)

    def cancel(self, done: Callable[[CancelAnswer], None]) -> None:
        self._calls.call(self._port, self._name + _CANCEL, self.goal_id, done)

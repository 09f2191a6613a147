"""A client of one action: one goal at a time, reported with its number.

A request, an answer or a result can be lost while a process is being discovered, or belong to a process that has
restarted. A goal therefore has its id before it is sent, and its result can be requested again.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any, Protocol

from robot_stack.contract.model import Action
from robot_stack.core.goals import GoalStatus
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.port import CancelAnswer, ClientGoal

# Period of result requests for a goal that may be lost.
_ASK_S = 1.0
# An unknown goal counts as lost after this time; before, it may still be in transit.
_ON_THE_WAY_S = 2.0


class GoalEvents(Protocol):
    """Receives the events of the goals by their numbers, in the node's thread."""

    def accepted(self, call: int) -> None: ...
    def feedback(self, call: int, feedback: Any) -> None: ...

    def ended(self, call: int, status: GoalStatus, result: Any) -> None:
        """``result`` has no content if the status is UNKNOWN or REJECTED."""
        ...


class _Goal:
    def __init__(self, call: int, sent_s: float) -> None:
        self.call = call
        self.handle: ClientGoal
        self.accepted = self.cancelled = self.ended = False
        self.sent_s = self.last_s = sent_s
        self.asked_s = -math.inf

    def on_its_way(self, now_s: float) -> bool:
        return not self.accepted and not now_s - self.sent_s > _ON_THE_WAY_S


class GoalClient:
    """Times are those of ``StackNode.steady_s``."""

    def __init__(self, node: StackNode, row: Action, events: GoalEvents) -> None:
        self._node, self._events = node, events
        self._client = node.action_client(row)
        self._goal: _Goal | None = None
        # Goals accepted before this time are still to be cancelled, once a server offers the action.
        self._cancel_before: Any = None

    def served(self) -> bool:
        return self._client.server_is_ready()

    def start(self, call: int, request: Any) -> None:
        """Sends a goal. An earlier one that has not ended is no longer watched."""
        goal = self._goal = _Goal(call, self._node.steady_s())
        goal.handle = self._client.send_goal(request, partial(self._on_answer, goal), partial(self._on_feedback, goal))

    def cancel(self) -> None:
        """Cancels the goal, also if it is accepted later. May be repeated."""
        goal = self._goal
        if goal is None or goal.ended:
            return
        goal.cancelled = True
        goal.handle.cancel(partial(self._on_cancel_answer, goal))

    def cancel_everything(self) -> None:
        """Cancels all goals of the action from before now, of any client, as soon as a server offers it."""
        self.cancel()
        self._cancel_before = self._node.stamp()
        self.poll()

    def poll(self) -> None:
        """Call in every tick."""
        if self._cancel_before is not None and self._client.server_is_ready():
            self._client.cancel_all(self._cancel_before)
            self._cancel_before = None

    def ask(self) -> None:
        """Requests the result of an accepted goal again, at most once a second: it ends if the server lost it."""
        goal, now_s = self._goal, self._node.steady_s()
        if goal is None or not goal.accepted or goal.ended or now_s - goal.asked_s < _ASK_S:
            return
        goal.asked_s = now_s
        goal.handle.ask_result(partial(self._on_result, goal))

    def find_lost(self, silence_s: float) -> None:
        """Ends a goal whose server is gone or has not accepted it; checks one without feedback for ``silence_s``.

        For servers that publish feedback all the time.
        """
        goal, now_s = self._goal, self._node.steady_s()
        if goal is None or goal.ended:
            return
        if not self.served() or (not goal.accepted and not goal.on_its_way(now_s)):
            self._end(goal, GoalStatus.UNKNOWN, None)
        elif now_s - goal.last_s >= silence_s:
            self.ask()

    def _on_answer(self, goal: _Goal, accepted: bool) -> None:
        if accepted:
            self._on_accepted(goal)
        else:
            self._end(goal, GoalStatus.REJECTED, None)

    def _on_accepted(self, goal: _Goal) -> None:
        goal.last_s = self._node.steady_s()
        if goal.accepted:
            return
        goal.accepted = True
        goal.handle.ask_result(partial(self._on_result, goal))
        if goal.cancelled:
            self.cancel()
        self._events.accepted(goal.call)

    def _on_feedback(self, goal: _Goal, feedback: Any) -> None:
        self._on_accepted(goal)  # also if the acceptance was lost
        self._events.feedback(goal.call, feedback)

    def _on_result(self, goal: _Goal, status: GoalStatus, result: Any) -> None:
        self._end(goal, status, result)

    def _on_cancel_answer(self, goal: _Goal, answer: CancelAnswer) -> None:
        if answer is CancelAnswer.UNKNOWN_GOAL and not goal.on_its_way(self._node.steady_s()):
            self._end(goal, GoalStatus.UNKNOWN, None)

    def _end(self, goal: _Goal, status: GoalStatus, result: Any) -> None:
        if not goal.ended:
            goal.ended = True
            self._events.ended(goal.call, status, result)

"""The mission manager's client of the docking actions: one goal at a time, reported as events with its number."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from custom_msgs.action import Dock, Undock
from robot_stack.contract import actions
from robot_stack.contract.states import DockingState
from robot_stack.core.mission import Kind
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.port import ActionClient, CancelAnswer, ClientGoal, GoalStatus
from robot_stack.mission.events import DockingAccepted, DockingEnded, DockingEvent, DockingFeedback

_SAFETY_STOPS = {Kind.DOCK: Dock.Result.SAFETY_STOP, Kind.UNDOCK: Undock.Result.SAFETY_STOP}
_RESULTS = {Kind.DOCK: Dock.Result, Kind.UNDOCK: Undock.Result}
# Period of result requests for an unconfirmed goal: a request can be lost while a new process is being discovered.
_ASK_S = 1.0
# An unknown goal counts as lost after this time; before, it may still be in transit.
_ON_THE_WAY_S = 2.0
_FORGOTTEN = "docking_controller has no such goal: was it restarted?"


class _Goal:
    """A sent goal. Its number is assigned here, so it is valid whether or not the answer arrives."""

    def __init__(self, call: int, kind: Kind, sent_s: float) -> None:
        self.call = call
        self.kind = kind
        self.handle: ClientGoal
        self.accepted = self.cancelled = self.ended = False
        self.sent_s = sent_s
        self.asked_s = -math.inf

    def on_its_way(self, now_s: float) -> bool:
        return not self.accepted and not now_s - self.sent_s > _ON_THE_WAY_S


class DockingClient:
    """Callbacks run in the node's thread; ``report`` receives the goals' events."""

    def __init__(self, node: StackNode, report: Callable[[DockingEvent], None]) -> None:
        self._node = node
        self._report = report
        self._clients: dict[Kind, ActionClient] = {
            Kind.DOCK: node.action_client(actions.DOCK),
            Kind.UNDOCK: node.action_client(actions.UNDOCK),
        }
        self._goal: _Goal | None = None
        self._now_s = math.nan
        # Goals accepted before this time are still to be cancelled, once a server offers the action.
        self._cancel_before: dict[Kind, Any] = {}
        self._heard = True
        self._doubted = False

    def served(self) -> bool:
        """True if both actions are offered."""
        return all(client.server_is_ready() for client in self._clients.values())

    def start(self, call: int, kind: Kind, dock_id: str) -> None:
        """Sends a goal. The one before must have ended."""
        goal = self._goal = _Goal(call, kind, self._now_s)
        request = Dock.Goal(dock_id=dock_id) if kind is Kind.DOCK else Undock.Goal(dock_id=dock_id)
        goal.handle = self._clients[kind].send_goal(
            request, partial(self._on_answer, goal), partial(self._on_feedback, goal)
        )

    def cancel(self) -> None:
        """Cancels the goal, also if it is accepted later. May be repeated."""
        goal = self._goal
        if goal is None or goal.ended:
            return
        goal.cancelled = True
        goal.handle.cancel(partial(self._on_cancel_answer, goal))

    def cancel_everything(self) -> None:
        """Cancels all goals of both actions from before now, as soon as a server offers them."""
        self.cancel()
        self._cancel_before = {kind: self._node.stamp() for kind in self._clients}

    def poll(self, state: str, now_s: float) -> None:
        """Call in every tick. state: of /docking/status, empty while stale.

        A server that publishes again after a silence, or reports idle during a goal, may be a new process. Then it
        does not have the goal, and reports so when its result is requested.
        """
        self._now_s = now_s
        for kind, stamp in list(self._cancel_before.items()):
            if self._clients[kind].server_is_ready():
                self._clients[kind].cancel_all(stamp)
                del self._cancel_before[kind]
        heard = bool(state)
        self._doubted |= (heard and not self._heard) or state == DockingState.IDLE
        self._heard = heard
        if heard and self._doubted:
            self._ask(now_s)

    def _ask(self, now_s: float) -> None:
        goal = self._goal
        if goal is None or not goal.accepted or goal.ended or now_s - goal.asked_s < _ASK_S:
            return
        goal.asked_s = now_s
        goal.handle.ask_result(partial(self._on_result, goal))

    def _on_answer(self, goal: _Goal, accepted: bool) -> None:
        if accepted:
            self._on_accepted(goal)
        else:
            self._end(goal, DockingEnded(goal.call, False, "the goal was rejected"))

    def _on_accepted(self, goal: _Goal) -> None:
        if goal.accepted:
            return
        goal.accepted = True
        goal.handle.ask_result(partial(self._on_result, goal))
        if goal.cancelled:
            self.cancel()
        self._report(DockingAccepted(goal.call))

    def _on_feedback(self, goal: _Goal, feedback: Any) -> None:
        self._doubted = False
        self._on_accepted(goal)  # also if the acceptance was lost
        tries = feedback.tries if goal.kind is Kind.DOCK else 0
        self._report(DockingFeedback(goal.call, feedback.state, tries))

    def _on_result(self, goal: _Goal, status: GoalStatus, result: Any) -> None:
        if status is GoalStatus.UNKNOWN:
            self._end(goal, DockingEnded(goal.call, False, _FORGOTTEN))
            return
        success = result.success and status is GoalStatus.SUCCEEDED
        reason = "" if success else reason_of(goal.kind, result.error_code, result.reason)
        self._end(goal, DockingEnded(goal.call, success, reason, result.error_code == _SAFETY_STOPS[goal.kind]))

    def _on_cancel_answer(self, goal: _Goal, answer: CancelAnswer) -> None:
        if answer is CancelAnswer.UNKNOWN_GOAL and not goal.on_its_way(self._now_s):
            self._end(goal, DockingEnded(goal.call, False, _FORGOTTEN))

    def _end(self, goal: _Goal, event: DockingEnded) -> None:
        if not goal.ended:
            goal.ended = True
            self._report(event)


def reason_of(kind: Kind, code: int, reason: str) -> str:
    """The failure in words, with the name of its code: ``no marker in sight (MARKERS_NOT_FOUND)``."""
    result = _RESULTS[kind]
    names = (name for name in dir(type(result)) if name.isupper() and not name.startswith("_"))
    name = next((name for name in names if getattr(result, name) == code), f"error {code}")
    return f"{reason} ({name})" if reason else name

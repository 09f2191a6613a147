"""The mission manager's client of the docking actions: one goal at a time, reported as events with its number."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from custom_msgs.action import Dock, Undock
from robot_stack.contract import actions
from robot_stack.contract.states import DockingState
from robot_stack.core.goals import GoalStatus
from robot_stack.core.mission import Kind
from robot_stack.middleware.goal_client import GoalClient
from robot_stack.middleware.node import StackNode
from robot_stack.mission.events import DockingAccepted, DockingEnded, DockingEvent, DockingFeedback

_SAFETY_STOPS = {Kind.DOCK: Dock.Result.SAFETY_STOP, Kind.UNDOCK: Undock.Result.SAFETY_STOP}
_RESULTS = {Kind.DOCK: Dock.Result, Kind.UNDOCK: Undock.Result}
_NO_RESULT = {
    GoalStatus.REJECTED: "the goal was rejected",
    GoalStatus.UNKNOWN: "docking_controller has no such goal: was it restarted?",
}


class DockingClient:
    """Callbacks run in the node's thread; ``report`` receives the goals' events."""

    def __init__(self, node: StackNode, report: Callable[[DockingEvent], None]) -> None:
        rows = {Kind.DOCK: actions.DOCK, Kind.UNDOCK: actions.UNDOCK}
        self._clients = {kind: GoalClient(node, row, _Events(kind, self)) for kind, row in rows.items()}
        self.report = report
        self._fresh = True
        self.doubted = False

    def served(self) -> bool:
        """True if both actions are offered."""
        return all(client.served() for client in self._clients.values())

    def start(self, call: int, kind: Kind, dock_id: str) -> None:
        """Sends a goal. The one before must have ended."""
        self._clients[kind].start(
            call, Dock.Goal(dock_id=dock_id) if kind is Kind.DOCK else Undock.Goal(dock_id=dock_id)
        )

    def cancel(self) -> None:
        """Cancels the goal, also if it is accepted later. May be repeated."""
        for client in self._clients.values():
            client.cancel()

    def cancel_everything(self) -> None:
        """Cancels all goals of both actions from before now, as soon as a server offers them."""
        for client in self._clients.values():
            client.cancel_everything()

    def poll(self, state: str) -> None:
        """Call in every tick. state: of /docking/status, empty while stale.

        A server that publishes again after a silence, or reports idle during a goal, may be a new process. Then it
        does not have the goal, and reports so when its result is requested.
        """
        fresh = bool(state)
        self.doubted |= (fresh and not self._fresh) or state == DockingState.IDLE
        self._fresh = fresh
        for client in self._clients.values():
            client.poll()
            if fresh and self.doubted:
                client.ask()


class _Events:
    """The events of one of the actions, see ``GoalEvents``."""

    def __init__(self, kind: Kind, client: DockingClient) -> None:
        self._kind, self._client = kind, client

    def accepted(self, call: int) -> None:
        self._client.report(DockingAccepted(call))

    def feedback(self, call: int, feedback: Any) -> None:
        self._client.doubted = False
        tries = feedback.tries if self._kind is Kind.DOCK else 0
        self._client.report(DockingFeedback(call, feedback.state, tries))

    def ended(self, call: int, status: GoalStatus, result: Any) -> None:
        if status in _NO_RESULT:
            self._client.report(DockingEnded(call, False, _NO_RESULT[status]))
            return
        success = result.success and status is GoalStatus.SUCCEEDED
        reason = "" if success else reason_of(self._kind, result.error_code, result.reason)
        stopped = result.error_code == _SAFETY_STOPS[self._kind]
        self._client.report(DockingEnded(call, success, reason, stopped))


def reason_of(kind: Kind, code: int, reason: str) -> str:
    """The failure in words, with the name of its code: ``no marker in sight (MARKERS_NOT_FOUND)``."""
    result = _RESULTS[kind]
    names = (name for name in dir(type(result)) if name.isupper() and not name.startswith("_"))
    name = next((name for name in names if getattr(result, name) == code), f"error {code}")
    return f"{reason} ({name})" if reason else name

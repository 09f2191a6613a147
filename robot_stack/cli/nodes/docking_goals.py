"""An operator's docking goal: sent, monitored, cancelled on request."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient

from robot_stack.cli.errors import NoAnswer
from robot_stack.cli.nodes.operator import Operator
from robot_stack.contract import topics
from robot_stack.contract.model import Action, ContractViolation
from robot_stack.middleware.interfaces import interface_class
from robot_stack.ros.actions import new_goal


@dataclass(frozen=True, slots=True)
class Ended:
    """How a goal ended; reason is empty on success."""

    success: bool
    reason: str


def follow_action(
    row: Action,
    goal: dict[str, Any],
    report: Callable[[Any], None],
    timeout_s: float,
    end: Callable[[Any], Ended] | None = None,
) -> Ended:
    """Sends a goal, calls ``report`` with each feedback, and returns its end, which ``end`` reads from the result.

    KeyboardInterrupt cancels the goal; then its end is awaited for at most ``timeout_s``.
    Raises NoAnswer without a server, an answer or an end within ``timeout_s``.
    """
    if topics.OPERATOR_TOOL not in row.clients:
        raise ContractViolation(f"{topics.OPERATOR_TOOL} may not call {row.name}")
    action = interface_class(row.type)
    with Operator() as operator:
        client = ActionClient(operator.node, action, row.name)
        try:
            if not operator.wait(client.server_is_ready, timeout_s):
                raise NoAnswer(f"no {row.server} offers {row.name}: is it running?")
            handle = new_goal(client)
            answer = client.send_goal_async(action.Goal(**goal), lambda m: report(m.feedback), handle.goal_id)
            try:
                return _follow(operator, row, answer, timeout_s, end or _end)
            except NoAnswer:
                handle.cancel_goal_async()  # it is no longer monitored
                raise
        finally:
            client.destroy()


def _follow(operator: Operator, row: Action, answer: Any, timeout_s: float, end: Callable[[Any], Ended]) -> Ended:
    try:
        handle = _accepted(operator, row, answer, timeout_s)
        if handle is None:
            return Ended(False, f"{row.server} rejected the goal")
        result = handle.get_result_async()
        operator.wait(result.done, None)
    except KeyboardInterrupt:
        # A goal that was sent may be accepted at any moment: its end is waited for all the same.
        handle = _accepted(operator, row, answer, timeout_s)
        if handle is None:
            return Ended(False, f"{row.server} rejected the goal")
        result = handle.get_result_async()
        handle.cancel_goal_async()
        if not operator.wait(result.done, timeout_s):
            raise NoAnswer(f"{row.server} does not end the cancelled goal: stop the robot") from None
    return end(result.result())


def _accepted(operator: Operator, row: Action, answer: Any, timeout_s: float) -> Any:
    """The accepted goal's handle, None if it was rejected. Raises NoAnswer without an answer."""
    if not operator.wait(answer.done, timeout_s):
        raise NoAnswer(f"{row.server} does not answer")
    handle = answer.result()
    return handle if handle.accepted else None


def _end(answer: Any) -> Ended:
    result = answer.result
    if result.success and answer.status == GoalStatus.STATUS_SUCCEEDED:
        return Ended(True, "")
    if answer.status == GoalStatus.STATUS_UNKNOWN:
        return Ended(False, "the goal is unknown to the server")
    return Ended(
        False, f"{result.reason} (error {result.error_code})" if result.reason else f"error {result.error_code}"
    )

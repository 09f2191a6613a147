"""Actions of the port on rclpy's action server and client."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from uuid import uuid4

from action_msgs.msg import GoalStatus as GoalStatusMessage
from action_msgs.srv import CancelGoal
from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.action.client import ClientGoalHandle
from rclpy.node import Node
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

from robot_stack.core.goals import GoalStatus
from robot_stack.middleware.port import ActionGoal, CancelAnswer

_CANCEL_ANSWERS = {
    CancelGoal.Response.ERROR_NONE: CancelAnswer.ACCEPTED,
    CancelGoal.Response.ERROR_REJECTED: CancelAnswer.REJECTED,
    CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID: CancelAnswer.UNKNOWN_GOAL,
    CancelGoal.Response.ERROR_GOAL_TERMINATED: CancelAnswer.ALREADY_ENDED,
}
_STATUS = {
    GoalStatusMessage.STATUS_SUCCEEDED: GoalStatus.SUCCEEDED,
    GoalStatusMessage.STATUS_ABORTED: GoalStatus.ABORTED,
    GoalStatusMessage.STATUS_CANCELED: GoalStatus.CANCELED,
}


class RosActionServer:
    """Accepts every goal and every request to cancel."""

    def __init__(self, node: Node, action: Any, name: str, on_goal: Callable[[ActionGoal], None]) -> None:
        self._on_goal = on_goal
        self._server = ActionServer(node, action, name, self._execute, cancel_callback=lambda _: CancelResponse.ACCEPT)

    async def _execute(self, handle: Any) -> Any:
        goal = _Goal(handle)
        self._on_goal(goal)
        return await goal.ended


class _Goal:
    """See ``robot_stack.middleware.port.ActionGoal``. ``ended`` is a future of the result."""

    def __init__(self, handle: Any) -> None:
        self._handle = handle
        self.request = handle.request
        self.goal_id = bytes(handle.goal_id.uuid)
        self.ended = Future()

    @property
    def is_active(self) -> bool:
        return bool(self._handle.is_active) and not self.ended.done()

    @property
    def is_cancel_requested(self) -> bool:
        return bool(self._handle.is_cancel_requested)

    def publish_feedback(self, feedback: Any) -> None:
        self._handle.publish_feedback(feedback)

    def succeed(self, result: Any) -> None:
        self._handle.succeed()
        self.ended.set_result(result)

    def abort(self, result: Any) -> None:
        self._handle.abort()
        self.ended.set_result(result)

    def cancel(self, result: Any) -> None:
        self._handle.canceled()
        self.ended.set_result(result)


def new_goal(client: ActionClient) -> ClientGoalHandle:
    """A handle for a goal that is to be sent with ``goal_uuid=handle.goal_id``."""
    return ClientGoalHandle(client, UUID(uuid=list(uuid4().bytes)), client._action_type.Impl.SendGoalService.Response())


class RosActionClient:
    """Goals get their id here, before they are sent: a request or an answer can be lost while a new process is being
    discovered, or go to a killed process (DDS lists it for 20 s more). With its id a goal can be cancelled, and its
    result requested, all the same.
    """

    def __init__(self, node: Node, action: Any, name: str) -> None:
        self._client = ActionClient(node, action, name)
        self._cancel = node.create_client(CancelGoal, f"{name}/_action/cancel_goal")

    def server_is_ready(self) -> bool:
        return bool(self._client.server_is_ready()) and bool(self._cancel.service_is_ready())

    def send_goal(self, request: Any, accepted: Callable[[bool], None], feedback: Callable[[Any], None]) -> _ClientGoal:
        handle = new_goal(self._client)
        future = self._client.send_goal_async(request, lambda message: feedback(message.feedback), handle.goal_id)
        future.add_done_callback(lambda done: accepted(done.result().accepted))
        return _ClientGoal(handle)

    def cancel_all(self, before: Any) -> None:
        request = CancelGoal.Request()  # a zero goal id with a time: all goals up to then
        request.goal_info.stamp = before
        self._cancel.call_async(request)


class _ClientGoal:
    def __init__(self, handle: ClientGoalHandle) -> None:
        self._handle = handle

    def ask_result(self, done: Callable[[GoalStatus, Any], None]) -> None:
        def on_done(future: Any) -> None:
            answer = future.result()
            done(_STATUS.get(answer.status, GoalStatus.UNKNOWN), answer.result)

        self._handle.get_result_async().add_done_callback(on_done)

    def cancel(self, done: Callable[[CancelAnswer], None]) -> None:
        def on_done(future: Any) -> None:
            done(_CANCEL_ANSWERS[future.result().return_code])

        self._handle.cancel_goal_async().add_done_callback(on_done)

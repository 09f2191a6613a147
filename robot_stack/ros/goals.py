"""Goals of actions that are known from before they are sent, whether or not their answer arrives.

A request or an answer can be lost while a new process is being discovered, or is sent to one that was killed: DDS names
it for 20 s more. With its number a goal can be cancelled, and asked for, all the same.
"""

from __future__ import annotations

from uuid import uuid4

from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from unique_identifier_msgs.msg import UUID


def new_goal(client: ActionClient) -> ClientGoalHandle:
    """A handle for a goal that is to be sent with ``goal_uuid=handle.goal_id``."""
    return ClientGoalHandle(client, UUID(uuid=list(uuid4().bytes)), client._action_type.Impl.SendGoalService.Response())

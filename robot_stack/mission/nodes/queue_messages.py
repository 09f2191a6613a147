"""The queue of orders as messages: requests to change it, and its report."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from builtin_interfaces.msg import Time

from custom_msgs.msg import MissionOrder, MissionQueue, MissionWaypoint
from custom_msgs.srv import EditMissionQueue
from robot_stack.core.mission import Mission
from robot_stack.middleware.conversions import time_from_s, time_to_s
from robot_stack.mission import own_route
from robot_stack.mission.events import EditQueue, edit_queue
from robot_stack.mission.orders import Order, QueueReport


def request_of(request: EditMissionQueue.Request, find: Callable[[str], Mission]) -> EditQueue:
    """find: the mission of an id."""
    order = request.order
    return edit_queue(
        request.operation,
        find,
        order_id=order.id,
        mission_id=order.mission_id,
        origin=order.origin,
        priority=order.priority,
        earliest_s=time_to_s(order.earliest),
        steps=request.steps,
        waypoints=[_waypoint(waypoint) for waypoint in request.waypoints],
        first=request.first,
        more_follows=order.open,
    )


def _waypoint(message: MissionWaypoint) -> dict[str, Any]:
    action = own_route.action_of(message.action, message.wait_s, message.dock_id)
    waypoint = {"name": message.name, "x": message.x, "y": message.y, "yaw": message.yaw, "action": action}
    return waypoint | {"max_speed_mps": message.max_speed or None, "max_yaw_rate_radps": message.max_yaw_rate or None}


def report_message(report: QueueReport, stamp: Time) -> Any:
    queue = report.queue
    message = MissionQueue(
        held_by=report.held_by,
        reason=report.reason,
        orders=[_message(order) for order in queue.orders],
        current=[_message(order) for order in queue.under_way],
        ended=[_message(order) for order in queue.ended],
        paused_by=report.paused_by.value if report.paused_by else "",
    )
    message.header.stamp = stamp
    return message


def _message(order: Order) -> MissionOrder:
    return MissionOrder(
        id=order.id,
        mission_id=order.mission_id,
        origin=order.origin.value,
        priority=order.priority,
        earliest=time_from_s(order.earliest_s),
        open=order.open,
        state=order.state,
    )

"""The queue of orders as messages: requests to change it, and its report."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from builtin_interfaces.msg import Time

from custom_msgs.msg import MissionOrder, MissionQueue
from custom_msgs.srv import EditMissionQueue
from robot_stack.core.mission import Mission
from robot_stack.core.mission_library import MissionError
from robot_stack.middleware.conversions import time_from_s, time_to_s
from robot_stack.mission.events import EditQueue
from robot_stack.mission.orders import Operation, Order, Origin, QueueReport

_WITH_ORDER = (Operation.ADD, Operation.REPLACE)


def request_of(request: EditMissionQueue.Request, find: Callable[[str], Mission]) -> EditQueue | str:
    """The request, or why it makes no sense. find: the mission of an id; its MissionError is the request's problem."""
    try:
        operation = Operation(request.operation)
    except ValueError:
        return f"there is no operation {request.operation}"
    if operation not in _WITH_ORDER:
        return EditQueue(operation, order_id=request.order.id, steps=request.steps)
    try:
        return EditQueue(operation, _order(request.order, find))
    except MissionError as error:
        return EditQueue(operation, problem=str(error))
    except ValueError:
        return f"there is no origin {request.order.origin[:64]!r}; known: {', '.join(Origin)}"


def _order(message: MissionOrder, find: Callable[[str], Mission]) -> Order:
    return Order(
        id=message.id,
        mission_id=message.mission_id,
        origin=Origin(message.origin),
        priority=message.priority,
        earliest_s=time_to_s(message.earliest),
        mission=find(message.mission_id),
    )


def report_message(report: QueueReport, stamp: Time) -> Any:
    queue = report.queue
    message = MissionQueue(
        held_by=report.held_by,
        reason=report.reason,
        orders=[_message(order) for order in queue.orders],
        current=[_message(queue.current)] if queue.current else [],
        ended=[_message(order) for order in queue.ended],
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
        state=order.state,
    )

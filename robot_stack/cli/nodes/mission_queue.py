"""The mission manager's queue of orders, for an operator."""

from __future__ import annotations

from dataclasses import dataclass

from custom_msgs.msg import MissionOrder
from custom_msgs.srv import EditMissionQueue
from robot_stack.cli.errors import NoAnswer
from robot_stack.cli.nodes.operator import Operator
from robot_stack.contract import services, topics
from robot_stack.middleware.conversions import time_from_s, time_to_s


@dataclass(frozen=True, slots=True)
class ShownOrder:
    """earliest_s: Unix time, 0 = at once. open: its route may be extended."""

    id: str
    mission_id: str
    origin: str
    priority: int
    earliest_s: float
    under_way: bool
    open: bool


@dataclass(frozen=True, slots=True)
class Queue:
    """``/mission/queue`` as values: the order under way first. reason: why none starts, empty if they do.

    paused_by: origin that paused the one under way and may resume it, empty if there is none.
    """

    reason: str
    orders: tuple[ShownOrder, ...]
    paused_by: str

    @property
    def under_way(self) -> int:
        """The number of orders under way."""
        return sum(order.under_way for order in self.orders)


def read_queue(timeout_s: float) -> Queue:
    """Raises NoAnswer without a mission manager."""
    with Operator() as operator:
        message = operator.receive(topics.MISSION_QUEUE, timeout_s)
    if message is None:
        raise NoAnswer("no /mission/queue: is the stack running?")
    return Queue(
        message.reason, tuple(_shown(order) for order in (*message.current, *message.orders)), message.paused_by
    )


def edit_queue(
    operation: str,
    timeout_s: float,
    *,
    order_id: str = "",
    mission_id: str = "",
    priority: int = 100,
    earliest_s: float = 0.0,
    steps: int = 0,
) -> tuple[bool, str]:
    """(done, what was done or why not). operation: a constant of EditMissionQueue. Raises NoAnswer."""
    order = MissionOrder(
        id=order_id,
        mission_id=mission_id,
        origin=MissionOrder.CLI,
        priority=priority,
        earliest=time_from_s(earliest_s),
    )
    code = getattr(EditMissionQueue.Request, operation)
    with Operator() as operator:
        answer = operator.call(services.EDIT_MISSION_QUEUE, timeout_s, operation=code, order=order, steps=steps)
    return bool(answer.success), str(answer.message)


def _shown(order: MissionOrder) -> ShownOrder:
    under_way = order.state == MissionOrder.UNDER_WAY
    earliest_s = time_to_s(order.earliest)
    return ShownOrder(order.id, order.mission_id, order.origin, order.priority, earliest_s, under_way, order.open)

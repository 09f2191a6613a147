"""What a page's message asks of the queue of orders."""

from __future__ import annotations

from dataclasses import dataclass

from robot_stack.ui import protocol as p


@dataclass(frozen=True, slots=True)
class QueueRequest:
    """operation: name of a constant of EditMissionQueue. earliest_s: of the node's clock, 0 = at once."""

    operation: str
    order_id: str = ""
    mission_id: str = ""
    priority: int = 0
    earliest_s: float = 0.0
    steps: int = 0


_WITHOUT_MISSION = {
    "order_remove": ("REMOVE", 0),
    "order_up": ("MOVE", -1),
    "order_down": ("MOVE", 1),
    "queue_hold": ("HOLD", 0),
    "queue_release": ("RELEASE", 0),
}


def queue_request(message: p.AddOrder | p.ChangeOrder | p.Queue, new_id: str, now_s: float) -> QueueRequest:
    """new_id: of an order that is added. now_s: of the node's clock, because that of a page may be wrong."""
    if isinstance(message, p.AddOrder):
        earliest_s = now_s + 60.0 * message.in_min if message.in_min else 0.0
        operation = "REPLACE" if message.now else "ADD"
        return QueueRequest(operation, new_id, message.mission, message.priority, earliest_s)
    operation, steps = _WITHOUT_MISSION[message.t]
    return QueueRequest(operation, message.order if isinstance(message, p.ChangeOrder) else "", steps=steps)

"""What a page's message asks of the queue."""

from __future__ import annotations

import pytest

from custom_msgs.srv import EditMissionQueue
from robot_stack.ui import protocol as p
from robot_stack.ui.orders import QueueRequest, queue_request

NOW_S = 1_700_000_000.0


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ('{"t": "order", "mission": "tour"}', QueueRequest("ADD", "new", "tour", 100)),
        (
            '{"t": "order", "mission": "tour", "priority": 200, "in_min": 15}',
            QueueRequest("ADD", "new", "tour", 200, NOW_S + 900.0),
        ),
        ('{"t": "order", "mission": "tour", "now": true}', QueueRequest("REPLACE", "new", "tour", 100)),
        ('{"t": "order_up", "order": "a"}', QueueRequest("MOVE", "a", steps=-1)),
        ('{"t": "order_down", "order": "a"}', QueueRequest("MOVE", "a", steps=1)),
        ('{"t": "order_remove", "order": "a"}', QueueRequest("REMOVE", "a")),
        ('{"t": "queue_hold"}', QueueRequest("HOLD")),
        ('{"t": "queue_release"}', QueueRequest("RELEASE")),
    ],
)
def test_request(text: str, wanted: QueueRequest) -> None:
    message = p.parse(text)
    assert isinstance(message, p.AddOrder | p.ChangeOrder | p.Queue)
    assert queue_request(message, "new", NOW_S) == wanted
    assert hasattr(EditMissionQueue.Request, wanted.operation)

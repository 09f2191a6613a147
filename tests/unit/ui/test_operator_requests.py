"""Requests of a page to a service: each answer belongs to its own request."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

from robot_stack.contract import services
from robot_stack.middleware.node import StackNode
from robot_stack.ui.nodes.operator_requests import (
    NO_DOCKING,
    NO_MISSIONS,
    QUEUE_REFUSALS,
    UNDOCK_BUSY,
    OperatorRequest,
    UndockRequest,
)
from robot_stack.ui.params import ResetParams

PARAMS = ResetParams(tries=1, pause_s=0.05, timeout_s=3.0)


class Node:
    """A service that answers when the test says so, and timers by hand."""

    def __init__(self) -> None:
        self.calls: list[tuple[Any, Callable[[Any], None]]] = []
        self.timers: list[tuple[float, Callable[[], None]]] = []

    def client(self, _: Any) -> Any:
        return SimpleNamespace(
            service_is_ready=lambda: True, call=lambda request, answer: self.calls.append((request, answer))
        )

    def create_timer(self, seconds: float, callback: Callable[[], None]) -> Any:
        timer = seconds, callback
        self.timers.append(timer)
        gone = lambda: self.timers.remove(timer) if timer in self.timers else None  # noqa: E731
        return SimpleNamespace(reset=lambda: None, destroy=gone)

    def fire(self, seconds: float) -> None:
        for timer in [item for item in self.timers if item[0] == seconds]:
            timer[1]()


def test_a_late_response_is_not_the_answer_to_the_next_request() -> None:
    node, answers = Node(), []
    request = OperatorRequest(cast(StackNode, node), PARAMS, services.EDIT_MISSION_QUEUE, 1, QUEUE_REFUSALS)

    def ask(operation: int) -> None:
        request.ask(lambda *answer: answers.append((operation, *answer)), operation=operation)

    ask(0)
    node.fire(PARAMS.pause_s)
    node.fire(PARAMS.timeout_s)
    assert answers == [(0, False, NO_MISSIONS, "")]
    ask(3)
    _, late = node.calls[0]
    late(SimpleNamespace(success=True, message="order waits at place 1"))
    assert len(answers) == 1
    node.fire(PARAMS.pause_s)
    sent, answer = node.calls[1]
    assert sent.operation == 3
    answer(SimpleNamespace(success=True, message="held"))
    assert answers[1:] == [(3, True, "", "held")]


def test_every_undocking_is_answered_also_without_a_server() -> None:
    ready, now_s, answers = [False], [0.0], []
    client = SimpleNamespace(server_is_ready=lambda: ready[0], send_goal=lambda *_: SimpleNamespace())
    request = UndockRequest(cast(StackNode, SimpleNamespace(action_client=lambda _: client, steady_s=lambda: now_s[0])))

    def ask(number: int) -> None:
        request.ask(lambda granted, why, _: answers.append((number, granted, why)))

    ask(1)
    assert answers == [(1, False, NO_DOCKING)]
    ready[0] = True
    ask(2)
    ask(3)
    assert answers[1:] == [(3, False, UNDOCK_BUSY)]
    request.poll()
    now_s[0] = 3.0  # the goal was lost
    request.poll()
    assert answers[2:] == [(2, False, NO_DOCKING)]
    ask(4)
    assert len(answers) == 3

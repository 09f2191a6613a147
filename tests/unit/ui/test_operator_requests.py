"""Requests of a page to a service: each answer belongs to its own request."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

from robot_stack.contract import services
from robot_stack.middleware.node import StackNode
from robot_stack.ui.nodes.operator_requests import (
    DISCOVERY_S,
    NO_DOCKING,
    NO_MISSIONS,
    QUEUE_REFUSALS,
    UNDOCK_BUSY,
    UNDOCK_REFUSED,
    OperatorRequest,
    UndockRequest,
)
from robot_stack.ui.params import ResetParams

PARAMS = ResetParams(tries=1, pause_s=0.05, timeout_s=3.0)


class Node:
    """A service and an action that answer when the test says so, and timers by hand."""

    def __init__(self, *, ready: bool = True) -> None:
        self.ready = ready
        self.now_s = 0.0
        self.goals: list[Callable[[bool], None]] = []
        self.calls: list[tuple[Any, Callable[[Any], None]]] = []
        self.timers: list[tuple[float, Callable[[], None]]] = []

    def client(self, _: Any) -> Any:
        return SimpleNamespace(
            service_is_ready=lambda: self.ready, call=lambda request, answer: self.calls.append((request, answer))
        )

    def action_client(self, _: Any) -> Any:
        def send_goal(_: Any, answered: Callable[[bool], None], __: Any) -> Any:
            self.goals.append(answered)
            return SimpleNamespace()

        return SimpleNamespace(server_is_ready=lambda: self.ready, send_goal=send_goal)

    def steady_s(self) -> float:
        return self.now_s

    def create_timer(self, seconds: float, callback: Callable[[], None]) -> Any:
        timer = seconds, callback
        self.timers.append(timer)
        gone = lambda: self.timers.remove(timer) if timer in self.timers else None  # noqa: E731
        return SimpleNamespace(reset=lambda: None, destroy=gone)

    def fire(self, seconds: float) -> None:
        for timer in [item for item in self.timers if item[0] == seconds]:
            timer[1]()

    def pass_time(self, seconds: float) -> None:
        """Calls the timers that are due, and those that they create, until ``seconds`` are over."""
        while (first_s := min((timer[0] for timer in self.timers), default=seconds + 1.0)) <= seconds:
            seconds -= first_s
            self.fire(first_s)


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


def test_a_service_in_discovery_is_waited_for_and_a_missing_one_is_answered() -> None:
    node, answers = Node(ready=False), []
    request = OperatorRequest(cast(StackNode, node), PARAMS, services.EDIT_MISSION_QUEUE, 1, QUEUE_REFUSALS)
    request.ask(lambda *answer: answers.append(answer), operation=0)
    node.pass_time(1.0)
    assert (answers, node.calls) == ([], [])
    node.ready = True
    node.pass_time(0.2)
    node.calls[0][1](SimpleNamespace(success=True, message="held"))
    assert answers == [(True, "", "held")]
    node.ready = False
    request.ask(lambda *answer: answers.append(answer), operation=0)
    node.pass_time(DISCOVERY_S + 0.01)
    assert answers[1:] == [(False, NO_MISSIONS, "")]
    assert node.timers == []


def test_every_undocking_is_answered_also_without_a_server() -> None:
    node, answers = Node(ready=False), []
    request = UndockRequest(cast(StackNode, node))

    def ask(number: int) -> None:
        request.ask(lambda granted, why, _: answers.append((number, granted, why)))

    ask(1)
    assert answers == [], "the server may be in discovery"
    node.pass_time(DISCOVERY_S + 0.01)
    assert answers == [(1, False, NO_DOCKING)]
    ask(2)
    node.ready = True
    node.pass_time(0.2)
    ask(3)
    assert answers[1:] == [(3, False, UNDOCK_BUSY)]
    request.poll()
    node.now_s = 3.0  # the goal was lost
    request.poll()
    assert answers[2:] == [(2, False, NO_DOCKING)]
    ask(4)
    node.goals[-1](False)
    assert answers[3:] == [(4, False, UNDOCK_REFUSED)]
    ask(5)
    assert (len(node.goals), len(answers)) == (3, 4)

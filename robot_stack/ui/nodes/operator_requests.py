"""Requests of a page to the safety monitor (release, clearing an absent stop source), mission manager, docking and
navigation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from custom_msgs.action import Undock
from robot_stack.contract import actions
from robot_stack.contract.model import Service
from robot_stack.core.goals import GoalStatus
from robot_stack.middleware.goal_client import GoalClient
from robot_stack.middleware.interfaces import interface_class
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.timers import NodeTimer
from robot_stack.ui.params import ResetParams

# (granted, key of the refusal's text, the server's own text)
Answer = Callable[[bool, str, str], None]


@dataclass(frozen=True, slots=True)
class Refusals:
    """Keys of texts: the server does not answer, it refuses, another request is under way."""

    silent: str
    refused: str
    busy: str


NO_MONITOR, REFUSED, BUSY = "answer.no_monitor", "answer.reset_refused", "answer.reset_busy"
NO_MISSIONS, QUEUE_REFUSED, QUEUE_BUSY = "answer.no_missions", "answer.queue_refused", "answer.queue_busy"
NO_DOCKING, UNDOCK_FAILED, UNDOCK_BUSY = "answer.no_docking", "answer.undock_failed", "answer.undock_busy"
UNDOCK_REFUSED = "answer.undock_refused"
NO_NAVIGATION, DOOR_REFUSED = "answer.no_navigation", "answer.door_refused"
RESET_REFUSALS = Refusals(NO_MONITOR, REFUSED, BUSY)
QUEUE_REFUSALS = Refusals(NO_MISSIONS, QUEUE_REFUSED, QUEUE_BUSY)
DOOR_REFUSALS = Refusals(NO_NAVIGATION, DOOR_REFUSED, BUSY)
UNDOCK_REFUSALS = Refusals(NO_DOCKING, UNDOCK_REFUSED, UNDOCK_BUSY)
_NO_RESULT = {GoalStatus.REJECTED: UNDOCK_REFUSED}
# A server may be in discovery when its button is touched; a person has an answer within 2 s.
DISCOVERY_S, _LOOK_S = 1.5, 0.1


class _Request:
    """One at a time. Every path responds exactly once. Waits up to ``DISCOVERY_S`` for the server."""

    def __init__(self, node: StackNode, texts: Refusals, ready: Callable[[], bool], send: Callable[[], None]) -> None:
        self._node, self._texts, self._ready, self._send = node, texts, ready, send
        self._answer: Answer | None = None
        self._timers: list[NodeTimer] = []

    def _begin(self, answer: Answer) -> None:
        """Calls ``send`` once the server is ready."""
        if self._answer is not None:
            answer(False, self._texts.busy, "")
            return
        self._answer = answer
        self._look(round(DISCOVERY_S / _LOOK_S))

    def _look(self, looks: int) -> None:
        if self._ready():
            self._send()
        elif looks:
            self._after(_LOOK_S, lambda: self._look(looks - 1))
        else:
            self._end(False, self._texts.silent, "")

    def _after(self, seconds: float, callback: Callable[[], None]) -> None:
        def once() -> None:
            timer.destroy()
            callback()

        timer = self._node.create_timer(seconds, once)
        timer.reset()  # from now, not from the schedule's next whole period
        self._timers.append(timer)

    def _end(self, granted: bool, why: str, detail: str) -> None:
        answer, self._answer = self._answer, None
        for timer in self._timers:
            timer.destroy()
        self._timers = []
        if answer is not None:
            answer(granted, why, detail)


class OperatorRequest(_Request):
    """A service call. A refused request is repeated, ``tries`` times in all."""

    def __init__(
        self, node: StackNode, params: ResetParams, row: Service, tries: int, texts: Refusals = RESET_REFUSALS
    ) -> None:
        self._params, self._tries_max = params, tries
        self._service = interface_class(row.type)
        self._client = node.client(row)
        self._fields: dict[str, Any] = {}
        self._tries = 0
        self._number = 0  # of the request: a late response to the one before is not the answer to this one
        super().__init__(node, texts, self._client.service_is_ready, self._start)

    def ask(self, answer: Answer, **fields: Any) -> None:
        """fields: of the request."""
        if self._answer is None:
            self._fields, self._tries = fields, self._tries_max
            self._number += 1
        self._begin(answer)

    def _start(self) -> None:
        self._after(self._params.timeout_s, lambda: self._end(False, self._texts.silent, ""))
        # The safety monitor requires the release to last a moment before it grants a reset.
        self._after(self._params.pause_s, self._call)

    def _call(self) -> None:
        if self._answer is not None:
            self._tries -= 1
            self._client.call(self._service.Request(**self._fields), partial(self._on_response, self._number))

    def _on_response(self, number: int, response: Any) -> None:
        if self._answer is None or number != self._number:
            return
        if response.success:
            self._end(True, "", response.message)
        elif self._tries > 0:
            self._after(self._params.pause_s, self._call)
        else:
            self._end(False, self._texts.refused, response.message)


class UndockRequest(_Request):
    """An undocking; the answer is its end."""

    # The docking controller publishes feedback at 10 Hz; without any for this time it is asked for the goal.
    _SILENCE_S = 1.0

    def __init__(self, node: StackNode) -> None:
        self._client = GoalClient(node, actions.UNDOCK, self)
        self._call = 0
        super().__init__(node, UNDOCK_REFUSALS, self._client.served, self._start)

    def ask(self, answer: Answer) -> None:
        self._begin(answer)

    def _start(self) -> None:
        self._call += 1
        self._client.start(self._call, Undock.Goal())

    def poll(self) -> None:
        """Call regularly: ends a request whose server is gone."""
        self._client.find_lost(self._SILENCE_S)

    def accepted(self, call: int) -> None:
        """A goal that is not accepted in time ends as UNKNOWN."""

    def feedback(self, call: int, feedback: Any) -> None:
        """Pages show /docking/status."""

    def ended(self, call: int, status: GoalStatus, result: Any) -> None:
        if result is None:
            self._end(False, _NO_RESULT.get(status, NO_DOCKING), "")
        elif result.success:
            self._end(True, "", "")
        else:
            self._end(False, UNDOCK_FAILED, result.reason)

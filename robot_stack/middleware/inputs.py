"""One subscribed topic: its newest message and its health."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from robot_stack.contract.model import Topic
from robot_stack.core.health import InputHealth


class Input:
    """The newest message of a topic, with the age taken on the steady clock when it was received.

    steady_s: now.
    """

    __slots__ = ("_callback", "_health", "_steady_s", "end", "ended", "latest", "received", "received_s", "topic")

    def __init__(
        self,
        topic: Topic,
        callback: Callable[[Any], None] | None,
        health: InputHealth,
        steady_s: Callable[[], float],
    ) -> None:
        self.topic = topic
        self.latest: Any = None
        self.received = 0
        self.received_s = -math.inf
        self.ended = False
        self.end: Callable[[], Any] = lambda: None  # of the subscription; called by StackNode.unsubscribe
        self._callback = callback
        self._health = health
        self._steady_s = steady_s
        health.add(topic.name, topic.stale_s)

    def on_message(self, message: Any, received_s: float) -> None:
        if self.ended:  # received by another thread before the end
            return
        self.latest = message
        self.received += 1
        self.received_s = received_s
        self._health.received(self.topic.name, received_s)
        if self._callback is not None:
            self._callback(message)

    def age_s(self) -> float:
        """Seconds since the newest message arrived; infinite before the first."""
        return self._health.age_s(self.topic.name, self._steady_s())

    def fresh(self) -> bool:
        """True if there is a message and it is not older than the contract's limit."""
        return self._health.fresh(self.topic.name, self._steady_s())

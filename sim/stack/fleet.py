"""The fleet's broker on the scheduler: a counterpart of ``robot_stack.fleet.nodes.mqtt_link.MqttLink``."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from robot_stack.fleet.link import Connected, LinkEvent, Received, Topic
from robot_stack.middleware.port import Port


class ScheduledBroker:
    """One robot and one master, in the process of the scheduler.

    messages: what the robot has sent, in its sequence, as JSON. listener: called with each of them.
    """

    def __init__(self, runs: Callable[[Port], bool]) -> None:
        """runs: whether the process of a port does."""
        self._runs = runs
        self._link: ScheduledLink | None = None
        self.messages: list[tuple[Topic, dict[str, Any]]] = []
        self.listener: Callable[[Topic, dict[str, Any]], object] = lambda topic, data: None

    def connect(
        self,
        port: Port,
        _params: Any,
        _client_id: str,
        _prefix: str,
        online: Callable[[], bytes],
        offline: Callable[[], bytes],
        will: Callable[[], bytes],
    ) -> ScheduledLink:
        """See ``MqttLink``."""
        will()
        self._link = ScheduledLink(self, port, offline)
        self.take(Topic.CONNECTION, online())
        return self._link

    def publish(self, topic: Topic, payload: bytes) -> None:
        """By the master. Lost if the robot is not connected, as with quality of service 0."""
        if self._link is not None and self._runs(self._link.port):
            self._link.events.append(Received(topic, payload))

    def take(self, topic: Topic, payload: bytes) -> None:
        """By the robot."""
        data = json.loads(payload)
        self.messages.append((topic, data))
        self.listener(topic, data)


class ScheduledLink:
    """See ``robot_stack.fleet.link.Link``."""

    def __init__(self, broker: ScheduledBroker, port: Port, offline: Callable[[], bytes]) -> None:
        self.port = port
        self.events: list[LinkEvent] = [Connected(session_present=False)]
        self._broker, self._offline = broker, offline

    def receive(self) -> tuple[LinkEvent, ...]:
        events, self.events = tuple(self.events), []
        return events

    def send(self, topic: Topic, payload: bytes) -> None:
        self._broker.take(topic, payload)

    def close(self) -> None:
        self._broker.take(Topic.CONNECTION, self._offline())

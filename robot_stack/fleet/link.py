"""The fleet agent's connection to its broker, as the node uses it.

``MqttLink`` is the connection over MQTT. Simulated, a dispatcher in the same process takes its place.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol


class Topic(StrEnum):
    """The last level of a VDA 5050 topic: ``interface/version/manufacturer/serial number/topic``."""

    ORDER = "order"
    INSTANT_ACTIONS = "instantActions"
    STATE = "state"
    VISUALIZATION = "visualization"
    CONNECTION = "connection"
    FACTSHEET = "factsheet"
    ZONE_SET = "zoneSet"  # from VDA 5050 3.0
    RESPONSES = "responses"  # from VDA 5050 3.0


@dataclass(frozen=True, slots=True)
class Connected:
    """session_present: the broker has kept the subscriptions and what was sent meanwhile."""

    session_present: bool


@dataclass(frozen=True, slots=True)
class Disconnected:
    """reason: for people."""

    reason: str


@dataclass(frozen=True, slots=True)
class Received:
    """A message as it came from the broker, not checked except for its size."""

    topic: Topic
    payload: bytes


LinkEvent = Connected | Disconnected | Received


class Link(Protocol):
    """No call blocks. Called from the node's thread only."""

    def receive(self) -> tuple[LinkEvent, ...]:
        """What has happened since the last call, in its order."""

    def send(self, topic: Topic, payload: bytes) -> None:
        """Publishes once connected. Of a topic that waits for the broker, only the newest message is kept."""

    def close(self) -> None:
        """Announces that the robot leaves, and disconnects."""

"""Headers of the messages sent (VDA 5050 2.1.0, 6.4; 3.0.0, 7.2), counted for each topic over all restarts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import count
from typing import Any, Final

from robot_stack.fleet import codec
from robot_stack.fleet.link import Topic
from robot_stack.fleet.params import Identity
from robot_stack.fleet.version import Version

SENT: Final = (Topic.STATE, Topic.VISUALIZATION, Topic.CONNECTION, Topic.FACTSHEET)
_MODULUS: Final = 2**32  # headerId is a uint32
# Reserved at a time: a restart leaves a gap of at most this many.
BLOCK: Final = 10_000
_LOW: Final = 1000


class Headers:
    """``next`` of one topic is called in one thread; each topic may have a thread of its own.

    reserved: per topic, ids below may have been sent already.
    """

    def __init__(self, identity: Identity, version: Version, reserved: Mapping[str, int]) -> None:
        self._identity, self.version = identity, version
        self._counters = {topic: count(reserved.get(topic, 0)) for topic in SENT}
        self._last = {topic: reserved.get(topic, 0) for topic in SENT}
        self._reserved = {topic: reserved.get(topic, 0) for topic in SENT}

    def next(self, topic: Topic, unix_s: float) -> dict[str, Any]:
        self._last[topic] = next(self._counters[topic])
        header = {"headerId": self.last(topic), "timestamp": codec.timestamp(unix_s), "version": self.version.value}
        return header | self._identity.robot()

    def last(self, topic: Topic) -> int:
        """headerId of the newest message."""
        return self._last[topic] % _MODULUS

    def reserve(self) -> dict[str, int]:
        """What is to be on the disk before further messages are sent."""
        for topic, last in self._last.items():
            if self._reserved[topic] - last < _LOW:
                self._reserved[topic] = last + BLOCK
        return {topic.value: number for topic, number in self._reserved.items()}


class ConnectionMessages:
    """Payloads of the topic connection (2.1.0, 6.14; 3.0.0, 6.5), for the link's thread. unix_s: the clock."""

    def __init__(self, headers: Headers, unix_s: Callable[[], float]) -> None:
        self._headers, self._unix_s = headers, unix_s

    def online(self) -> bytes:
        return self._message("ONLINE")

    def offline(self) -> bytes:
        return self._message("OFFLINE")

    def broken(self) -> bytes:
        """The last will: its timestamp is that of the connection."""
        return self._message("CONNECTIONBROKEN")

    def _message(self, state: str) -> bytes:
        header = self._headers.next(Topic.CONNECTION, self._unix_s())
        return codec.encode(Topic.CONNECTION, header | {"connectionState": state}, self._headers.version)

"""Faults of messages on their way. Each rule draws from a random stream of its own."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

from robot_stack.contract.model import Topic
from robot_stack.middleware.interfaces import interface_class
from robot_stack.ros.serialization import deserialize_message, serialize_message
from sim.scheduler.events import NANOSECONDS, NEVER
from sim.scheduler.params import Spread
from sim.scheduler.streams import Streams


@dataclass(frozen=True, slots=True)
class Transfer:
    """A message on its way to one subscriber. in_order: it waits for those that were sent before it."""

    data: bytes
    delay_ns: int
    in_order: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageRule:
    """A fault that meets a message on its way to one subscriber with a probability.

    name: of the rule and of its random stream. topic, publisher, subscriber: None for any. from_s, until_s: virtual
    time, the end excluded.
    """

    name: str
    topic: str | None = None
    publisher: str | None = None
    subscriber: str | None = None
    probability: float = 1.0
    from_s: float = 0.0
    until_s: float = math.inf
    from_ns: int = field(init=False, default=0)
    until_ns: int = field(init=False, default=NEVER)

    def __post_init__(self) -> None:
        if not 0.0 <= self.probability <= 1.0:
            raise ValueError(f"{self.name}: the probability must be in [0, 1], is {self.probability}")
        object.__setattr__(self, "from_ns", round(self.from_s * NANOSECONDS))
        object.__setattr__(self, "until_ns", NEVER if self.until_s == math.inf else round(self.until_s * NANOSECONDS))

    def matches(self, topic: str, publisher: str, subscriber: str) -> bool:
        return (
            self.topic in (None, topic)
            and self.publisher in (None, publisher)
            and self.subscriber in (None, subscriber)
        )

    def applies(self, streams: Streams) -> bool:
        """Draws even if the outcome is certain: a changed probability shifts no other draw."""
        return bool(streams.generator(self._stream).random() < self.probability)

    def change(self, transfers: list[Transfer], row: Topic, streams: Streams) -> list[Transfer]:
        """The effect on a message."""
        raise NotImplementedError

    @property
    def _stream(self) -> str:
        return f"rule/{self.name}"

    def _extra_ns(self, streams: Streams, extra: Spread) -> int:
        return streams.delays(f"{self._stream}/extra", extra).draw()


@dataclass(frozen=True, slots=True, kw_only=True)
class Lose(MessageRule):
    def change(self, transfers: list[Transfer], row: Topic, streams: Streams) -> list[Transfer]:
        return []


@dataclass(frozen=True, slots=True, kw_only=True)
class Delay(MessageRule):
    """The message and those after it come later by ``extra``."""

    extra: Spread

    def change(self, transfers: list[Transfer], row: Topic, streams: Streams) -> list[Transfer]:
        extra_ns = self._extra_ns(streams, self.extra)
        return [replace(item, delay_ns=item.delay_ns + extra_ns) for item in transfers]


@dataclass(frozen=True, slots=True, kw_only=True)
class Duplicate(MessageRule):
    """The message arrives a second time, later by ``extra``, regardless of messages in between."""

    extra: Spread

    def change(self, transfers: list[Transfer], row: Topic, streams: Streams) -> list[Transfer]:
        extra_ns = self._extra_ns(streams, self.extra)
        again = [replace(item, delay_ns=item.delay_ns + extra_ns, in_order=False) for item in transfers]
        return [*transfers, *again]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reorder(MessageRule):
    """The message arrives later by ``extra``; those after it may overtake it."""

    extra: Spread

    def change(self, transfers: list[Transfer], row: Topic, streams: Streams) -> list[Transfer]:
        extra_ns = self._extra_ns(streams, self.extra)
        return [replace(item, delay_ns=item.delay_ns + extra_ns, in_order=False) for item in transfers]


@dataclass(frozen=True, slots=True, kw_only=True)
class Corrupt(MessageRule):
    """A field of the message becomes ``value``. path: with dots; a number is an index, e.g. ``pose.position.x``."""

    path: str
    value: Any = math.nan

    def change(self, transfers: list[Transfer], row: Topic, streams: Streams) -> list[Transfer]:
        return [replace(item, data=with_field(item.data, row.type, self.path, self.value)) for item in transfers]


def with_field(data: bytes, type_name: str, path: str, value: Any) -> bytes:
    """A serialised message with another value in one field. Raises ValueError for a field that it does not have."""
    message = deserialize_message(data, interface_class(type_name))
    *outer, last = path.split(".")
    part: Any = message
    try:
        for name in outer:
            part = part[int(name)] if name.isdigit() else getattr(part, name)
        if last.isdigit():
            part[int(last)] = value
        else:
            getattr(part, last)  # a message accepts no new fields, but the error would be less clear
            setattr(part, last, value)
    except (AttributeError, IndexError, TypeError) as error:
        raise ValueError(f"{type_name} has no field {path!r} that takes {value!r}") from error
    return bytes(serialize_message(message))

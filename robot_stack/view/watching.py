"""Tracks the viewers' subscriptions: a topic is subscribed to only while a viewer uses it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from robot_stack.contract.model import Durability, Topic
from robot_stack.view.channels import MODEL, MODEL_INPUTS


@dataclass(frozen=True, slots=True)
class Change:
    """Subscriptions to end and to begin, in this order. A topic in both is renewed."""

    end: tuple[str, ...] = ()
    begin: tuple[str, ...] = ()


class Watching:
    """rows: the available topics by name; other names are ignored."""

    def __init__(self, rows: Mapping[str, Topic]) -> None:
        self._rows = rows
        self._viewers: dict[str, set[int]] = {}
        self._subscribed: set[str] = set()

    @property
    def topics(self) -> frozenset[str]:
        """Topics that are subscribed to now."""
        return frozenset(self._subscribed)

    def looked_at(self, channel: str) -> bool:
        return bool(self._viewers.get(channel))

    def begin(self, client: int, channel: str) -> Change:
        """A client subscribes to a channel."""
        self._viewers.setdefault(channel, set()).add(client)
        change = self._settle()
        latched = tuple(
            name
            for name in self._sources(channel)
            if name not in change.begin and self._rows[name].qos.durability is Durability.TRANSIENT_LOCAL
        )
        # Latched messages from before this client are received again only by a new subscription.
        return Change((*change.end, *latched), (*change.begin, *latched))

    def end(self, client: int, channel: str) -> Change:
        """A client unsubscribes from a channel or disconnects."""
        self._viewers.get(channel, set()).discard(client)
        return self._settle()

    def _sources(self, channel: str) -> tuple[str, ...]:
        names = [row.name for row in MODEL_INPUTS] if channel == MODEL else [channel]
        return tuple(name for name in names if name in self._rows)

    def _settle(self) -> Change:
        wanted = {name for channel, viewers in self._viewers.items() if viewers for name in self._sources(channel)}
        change = Change(tuple(sorted(self._subscribed - wanted)), tuple(sorted(wanted - self._subscribed)))
        self._subscribed = wanted
        return change

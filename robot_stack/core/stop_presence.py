"""Who presses the emergency stop, as the safety monitor tells it among the values of its entry in /diagnostics."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

_PREFIX = "emergency stop pressed by "


class Presence(StrEnum):
    """Whether a source that has pressed is there to release it; what is not there is cleared by an operator."""

    THERE = "there"
    GONE = "gone"
    UNKNOWN = "unknown"


def describe_presence(sources: Mapping[str, Presence]) -> dict[str, str]:
    """Keys and values of a diagnostic status; ``parse_presence`` reads them."""
    return {f"{_PREFIX}{name}": presence.value for name, presence in sources.items()}


def parse_presence(values: Mapping[str, str]) -> dict[str, Presence]:
    """The sources that press, by name. A value that says nothing known is a source that is there."""
    known = {presence.value: presence for presence in Presence}
    return {
        key.removeprefix(_PREFIX): known.get(value, Presence.THERE)
        for key, value in values.items()
        if key.startswith(_PREFIX)
    }

"""The pressed emergency stop sources, as values of the safety monitor's entry in /diagnostics."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

_PREFIX = "emergency stop pressed by "


class Presence(StrEnum):
    """Whether a pressed source is still present to release it; the operator clears an absent one."""

    THERE = "there"
    GONE = "gone"
    UNKNOWN = "unknown"


def describe_presence(sources: Mapping[str, Presence]) -> dict[str, str]:
    """Keys and values of a diagnostic status; ``parse_presence`` reads them."""
    return {f"{_PREFIX}{name}": presence.value for name, presence in sources.items()}


def parse_presence(values: Mapping[str, str]) -> dict[str, Presence]:
    """The pressed sources, by name. An unrecognised value counts as a source that is present."""
    known = {presence.value: presence for presence in Presence}
    return {
        key.removeprefix(_PREFIX): known.get(value, Presence.THERE)
        for key, value in values.items()
        if key.startswith(_PREFIX)
    }

"""The audit log of operator actions: user, action, time and outcome. One JSON object a line."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from robot_stack.contract.states import ENDED

_LENGTH_MAX = 200


@dataclass(frozen=True, slots=True)
class Entry:
    """at: UTC, ISO 8601. who: page, its address and role. what: the action. outcome: ``ok`` or the reason."""

    at: str
    who: str
    what: str
    outcome: str


def ends_ride(before: str, state: str) -> bool:
    """True if the mission state ``state`` after ``before`` is an end to record. before: empty while unknown."""
    return bool(before) and state != before and state in ENDED


def line(entry: Entry) -> str:
    """The entry's text without line breaks and control characters."""
    fields = {name: getattr(entry, name)[:_LENGTH_MAX] for name in ("at", "who", "what", "outcome")}
    return json.dumps(fields, ensure_ascii=True)


def read(text: str, newest: int) -> list[Entry]:
    """The newest entries of a log, oldest first; incomplete lines are left out."""
    return [entry for entry in map(_entry, text.splitlines()[-newest:]) if entry is not None]


def _entry(text: str) -> Entry | None:
    try:
        fields: Any = json.loads(text)
        return Entry(*(str(fields[name]) for name in ("at", "who", "what", "outcome")))
    except (ValueError, KeyError, TypeError):
        return None

"""Service responses: success and a text of the documented form."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from robot_stack.wmx.api import EngineState

Explain = Callable[[int], str]
"""The text of an error code, from the module that returned it."""


@dataclass(frozen=True, slots=True)
class Answer:
    success: bool
    message: str


def failure(what: str, code: int, explain: Explain) -> Answer:
    """``what`` failed with an error code of the engine."""
    return Answer(False, f"{what}. Error={int(code)} ({explain(code)})")


def joined(entries: Iterable[Answer]) -> Answer:
    """The answer for several axes: every text followed by "; ", a success only if all are."""
    entries = list(entries)
    return Answer(all(entry.success for entry in entries), "".join(f"{entry.message}; " for entry in entries))


def state_name(state: int) -> str:
    """The engine state's name in the status service."""
    try:
        return EngineState(state).name
    except ValueError:
        return "Invalid"

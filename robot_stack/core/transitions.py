"""State transition tables: (state, trigger) to the next state. A controller takes all transitions from its table."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Generic, TypeVar

StateT = TypeVar("StateT", bound=Enum)
TriggerT = TypeVar("TriggerT", bound=Enum)


@dataclass(frozen=True, slots=True)
class Transition(Generic[StateT, TriggerT]):
    source: StateT
    trigger: TriggerT
    target: StateT


def rows(sources: Iterable[StateT], trigger: TriggerT, target: StateT) -> tuple[Transition[StateT, TriggerT], ...]:
    """One trigger that leads to the same state from several."""
    return tuple(Transition(source, trigger, target) for source in sources)


def table_of(transitions: Iterable[Transition[StateT, TriggerT]]) -> dict[tuple[StateT, TriggerT], StateT]:
    """(state, trigger) -> the state that it leads to."""
    return {(row.source, row.trigger): row.target for row in transitions}

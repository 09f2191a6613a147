"""The states of docking and every way from one to the next: the single truth that the controller asks."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class State(Enum):
    """As in DockingStatus. SERVOING also while the robot backs off from an opened latch."""

    IDLE = "IDLE"
    APPROACH = "APPROACH"  # to the staging pose, by navigation or backwards from a failed try
    SEARCH = "SEARCH"
    SERVOING = "SERVOING"
    FINE_ALIGN = "FINE_ALIGN"
    DOCKED = "DOCKED"  # at the dock pose; latching, latched or unlatching
    FAILED = "FAILED"


class Trigger(Enum):
    DOCK = "asked to dock"
    UNDOCK = "asked to undock"
    STAGED = "at the staging pose"
    STAGED_ONLY = "at the staging pose, and no more was asked for"
    FOUND = "markers found"
    NEAR = "before the dock pose"
    ALIGNED = "aligned for long enough"
    LOST = "markers lost for too long"
    TRY_FAILED = "try failed, tries left"
    UNLATCHED = "latch open"
    CLEAR = "clear of the dock"
    GAVE_UP = "failed"
    CANCELLED = "cancelled"
    ATTACHED = "found with a closed latch"


@dataclass(frozen=True, slots=True)
class Transition:
    source: State
    trigger: Trigger
    target: State


_RESTING = (State.IDLE, State.DOCKED, State.FAILED)
ACTIVE = (State.APPROACH, State.SEARCH, State.SERVOING, State.FINE_ALIGN, State.DOCKED)


def _rows(sources: tuple[State, ...], trigger: Trigger, target: State) -> tuple[Transition, ...]:
    return tuple(Transition(source, trigger, target) for source in sources)


TRANSITIONS: tuple[Transition, ...] = (
    *_rows((State.IDLE, State.FAILED), Trigger.DOCK, State.APPROACH),
    *_rows((State.APPROACH,), Trigger.STAGED, State.SEARCH),
    *_rows((State.APPROACH,), Trigger.STAGED_ONLY, State.IDLE),
    *_rows((State.SEARCH,), Trigger.FOUND, State.SERVOING),
    *_rows((State.SERVOING,), Trigger.NEAR, State.FINE_ALIGN),
    *_rows((State.FINE_ALIGN,), Trigger.ALIGNED, State.DOCKED),
    *_rows((State.SERVOING, State.FINE_ALIGN), Trigger.LOST, State.SEARCH),
    *_rows(ACTIVE, Trigger.TRY_FAILED, State.APPROACH),
    *_rows(_RESTING, Trigger.UNDOCK, State.DOCKED),
    *_rows((State.DOCKED,), Trigger.UNLATCHED, State.SERVOING),
    *_rows((State.SERVOING,), Trigger.CLEAR, State.IDLE),
    *_rows(ACTIVE, Trigger.GAVE_UP, State.FAILED),
    *_rows(ACTIVE, Trigger.CANCELLED, State.IDLE),
    *_rows((State.IDLE,), Trigger.ATTACHED, State.DOCKED),
)

_TABLE = {(row.source, row.trigger): row.target for row in TRANSITIONS}


def target_of(state: State, trigger: Trigger) -> State:
    """The state that ``trigger`` leads to. Raises KeyError for a trigger that means nothing in ``state``."""
    return _TABLE[state, trigger]

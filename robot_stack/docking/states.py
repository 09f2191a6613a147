"""The states of docking and all transitions between them, as used by the controller."""

from __future__ import annotations

from enum import Enum

from robot_stack.core.transitions import Transition, rows, table_of


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


_RESTING = (State.IDLE, State.DOCKED, State.FAILED)
ACTIVE = (State.APPROACH, State.SEARCH, State.SERVOING, State.FINE_ALIGN, State.DOCKED)


TRANSITIONS: tuple[Transition[State, Trigger], ...] = (
    *rows((State.IDLE, State.FAILED), Trigger.DOCK, State.APPROACH),
    *rows((State.APPROACH,), Trigger.STAGED, State.SEARCH),
    *rows((State.APPROACH,), Trigger.STAGED_ONLY, State.IDLE),
    *rows((State.SEARCH,), Trigger.FOUND, State.SERVOING),
    *rows((State.SERVOING,), Trigger.NEAR, State.FINE_ALIGN),
    *rows((State.FINE_ALIGN,), Trigger.ALIGNED, State.DOCKED),
    *rows((State.SERVOING, State.FINE_ALIGN), Trigger.LOST, State.SEARCH),
    *rows(ACTIVE, Trigger.TRY_FAILED, State.APPROACH),
    *rows(_RESTING, Trigger.UNDOCK, State.DOCKED),
    *rows((State.DOCKED,), Trigger.UNLATCHED, State.SERVOING),
    *rows((State.SERVOING,), Trigger.CLEAR, State.IDLE),
    *rows(ACTIVE, Trigger.GAVE_UP, State.FAILED),
    *rows(ACTIVE, Trigger.CANCELLED, State.IDLE),
    *rows((State.IDLE,), Trigger.ATTACHED, State.DOCKED),
)

_TABLE = table_of(TRANSITIONS)


def target_of(state: State, trigger: Trigger) -> State:
    """The state that ``trigger`` leads to. Raises KeyError for a trigger that is not valid in ``state``."""
    return _TABLE[state, trigger]

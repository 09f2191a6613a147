"""The states of docking and all transitions between them, as used by the controller."""

from __future__ import annotations

from enum import Enum

from robot_stack.contract.states import DockingState
from robot_stack.core.transitions import Transition, rows, table_of


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
    ATTACHED = "found with a closed latch, or not clear of a station"


_RESTING = (DockingState.IDLE, DockingState.DOCKED, DockingState.FAILED)
ACTIVE = (
    DockingState.APPROACH,
    DockingState.SEARCH,
    DockingState.SERVOING,
    DockingState.FINE_ALIGN,
    DockingState.DOCKED,
)


TRANSITIONS: tuple[Transition[DockingState, Trigger], ...] = (
    *rows((DockingState.IDLE, DockingState.FAILED), Trigger.DOCK, DockingState.APPROACH),
    *rows((DockingState.DOCKED,), Trigger.DOCK, DockingState.DOCKED),
    *rows((DockingState.APPROACH,), Trigger.STAGED, DockingState.SEARCH),
    *rows((DockingState.APPROACH,), Trigger.STAGED_ONLY, DockingState.IDLE),
    *rows((DockingState.SEARCH,), Trigger.FOUND, DockingState.SERVOING),
    *rows((DockingState.SERVOING,), Trigger.NEAR, DockingState.FINE_ALIGN),
    *rows((DockingState.FINE_ALIGN,), Trigger.ALIGNED, DockingState.DOCKED),
    *rows((DockingState.SERVOING, DockingState.FINE_ALIGN), Trigger.LOST, DockingState.SEARCH),
    *rows(ACTIVE, Trigger.TRY_FAILED, DockingState.APPROACH),
    *rows(_RESTING, Trigger.UNDOCK, DockingState.DOCKED),
    *rows((DockingState.DOCKED,), Trigger.UNLATCHED, DockingState.SERVOING),
    *rows((DockingState.SERVOING, DockingState.DOCKED), Trigger.CLEAR, DockingState.IDLE),
    *rows(ACTIVE, Trigger.GAVE_UP, DockingState.FAILED),
    *rows(ACTIVE, Trigger.CANCELLED, DockingState.IDLE),
    *rows((DockingState.IDLE, DockingState.FAILED), Trigger.ATTACHED, DockingState.DOCKED),
)

_TABLE = table_of(TRANSITIONS)


def target_of(state: DockingState, trigger: Trigger) -> DockingState:
    """The state that ``trigger`` leads to. Raises KeyError for a trigger that is not valid in ``state``."""
    return _TABLE[state, trigger]

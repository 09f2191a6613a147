"""The states of the mission manager and every way from one to the next.

The table is the single truth: the kernel asks it, the tests walk it, and ``docs/mission_states.md`` is drawn from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class State(Enum):
    IDLE = "IDLE"  # no mission
    RUNNING = "RUNNING"  # driving to a waypoint
    WAITING = "WAITING"  # standing at a waypoint for its waiting time
    PAUSED = "PAUSED"  # standing until a person says RESUME
    STOPPED = "STOPPED"  # standing after an emergency stop, until it is released and a person says RESUME
    COMPLETED = "COMPLETED"  # the last waypoint was reached
    ABORTED = "ABORTED"  # a person ended the mission
    FAILED = "FAILED"  # the mission ended itself


ACTIVE = frozenset({State.RUNNING, State.WAITING, State.PAUSED, State.STOPPED})
# The robot may be moved by the mission, or will be without anybody asking.
UNDER_WAY = frozenset({State.RUNNING, State.WAITING})


class Trigger(Enum):
    START = "START_MISSION"
    PAUSE = "PAUSE"
    RESUME = "RESUME"
    ABORT = "ABORT"
    EMERGENCY_STOP = "emergency stop"
    WAIT_HERE = "waypoint with a waiting time reached"
    NEXT = "waypoint served, another follows"
    DONE = "last waypoint served"
    TRY_FAILED = "no progress, tries left"
    GAVE_UP = "no progress, no tries left"
    JOURNAL_LOST = "journal cannot be written"
    RESTORED = "restart with a mission in the journal"


@dataclass(frozen=True, slots=True)
class Transition:
    source: State
    trigger: Trigger
    target: State


def _rows(sources: tuple[State, ...], trigger: Trigger, target: State) -> tuple[Transition, ...]:
    return tuple(Transition(source, trigger, target) for source in sources)


_ENDED = (State.IDLE, State.COMPLETED, State.ABORTED, State.FAILED)
_MOVING = (State.RUNNING, State.WAITING)

TRANSITIONS: tuple[Transition, ...] = (
    *_rows(_ENDED, Trigger.START, State.RUNNING),
    *_rows(_MOVING, Trigger.PAUSE, State.PAUSED),
    *_rows((State.PAUSED, State.STOPPED), Trigger.RESUME, State.RUNNING),
    *_rows((*_MOVING, State.PAUSED, State.STOPPED), Trigger.ABORT, State.ABORTED),
    *_rows((*_MOVING, State.PAUSED), Trigger.EMERGENCY_STOP, State.STOPPED),
    *_rows((State.RUNNING,), Trigger.WAIT_HERE, State.WAITING),
    *_rows(_MOVING, Trigger.NEXT, State.RUNNING),
    *_rows(_MOVING, Trigger.DONE, State.COMPLETED),
    *_rows((State.RUNNING,), Trigger.TRY_FAILED, State.RUNNING),
    *_rows((State.RUNNING,), Trigger.GAVE_UP, State.FAILED),
    *_rows(_MOVING, Trigger.JOURNAL_LOST, State.PAUSED),
    *_rows((State.IDLE,), Trigger.RESTORED, State.PAUSED),
)

_TABLE: dict[tuple[State, Trigger], State] = {(row.source, row.trigger): row.target for row in TRANSITIONS}


def target_of(state: State, trigger: Trigger) -> State | None:
    """The state that ``trigger`` leads to, None if it means nothing in ``state``."""
    return _TABLE.get((state, trigger))

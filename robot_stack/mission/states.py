"""The states of the mission manager and all transitions between them.

The kernel uses this table, the tests walk it, and ``docs/mission_states.md`` is drawn from it.
"""

from __future__ import annotations

from enum import Enum

from robot_stack.core.transitions import Transition, rows, table_of


class State(Enum):
    IDLE = "IDLE"  # no mission
    RUNNING = "RUNNING"  # driving to a waypoint
    WAITING = "WAITING"  # standing at a waypoint for its waiting time, or at the end of an open route for its next part
    DOCKING = "DOCKING"  # at a waypoint whose dock is being docked to
    UNDOCKING = "UNDOCKING"  # at a waypoint where the robot is being undocked
    PAUSED = "PAUSED"  # standing until RESUME
    STOPPED = "STOPPED"  # standing after an emergency stop, until it is released and RESUME is received
    COMPLETED = "COMPLETED"  # the last waypoint was reached
    ABORTED = "ABORTED"  # a person ended the mission
    FAILED = "FAILED"  # the mission ended itself


# The docking controller moves the robot.
AT_DOCK = frozenset({State.DOCKING, State.UNDOCKING})
# The mission may move the robot, or will without a further command.
UNDER_WAY = frozenset({State.RUNNING, State.WAITING}) | AT_DOCK
# The mission goes on by RESUME only.
STANDING = frozenset({State.PAUSED, State.STOPPED})
ACTIVE = UNDER_WAY | STANDING


class Trigger(Enum):
    START = "START_MISSION"
    START_DOCKED = "START_MISSION while docked to a charger"
    PAUSE = "PAUSE"
    RESUME = "RESUME"
    RESUME_DOCKING = "RESUME of a docking"
    RESUME_UNDOCKING = "RESUME of an undocking"
    RESUME_DONE = "RESUME after the last waypoint was served meanwhile"
    RESUME_AWAITING = "RESUME at the end of an open route"
    ABORT = "ABORT"
    CANCEL = "CANCEL by the order's origin"
    EMERGENCY_STOP = "emergency stop"
    WAIT_HERE = "waypoint with a waiting time reached"
    DOCK_HERE = "waypoint with a dock reached"
    UNDOCK_HERE = "waypoint to undock at reached"
    NEXT = "waypoint served, another follows"
    DONE = "last waypoint served"
    AWAIT_PART = "last waypoint served, the route is open"
    EXTENDED = "next part of the route received"
    TRY_FAILED = "no progress, tries left"
    GAVE_UP = "no progress, no tries left"
    DOCKING_FAILED = "docking or undocking failed"
    JOURNAL_LOST = "journal cannot be written"
    RESTORED = "restart with a mission in the journal"
    REPLACE = "change of destination"
    TO_SAFE_PLACE = "battery critical, a safe place or a charger is known"
    SAFE_PLACE = "safe place reached, or docked to the charger"
    NO_SAFE_PLACE = "battery critical, no safe place is known"
    LOST = "localization lost for longer than localization_lost_s"


_ENDED = (State.IDLE, State.COMPLETED, State.ABORTED, State.FAILED)
_STANDING = (State.PAUSED, State.STOPPED)
_DOCKING = (State.DOCKING, State.UNDOCKING)
_MOVING = (State.RUNNING, State.WAITING, *_DOCKING)

TRANSITIONS: tuple[Transition[State, Trigger], ...] = (
    *rows(_ENDED, Trigger.START, State.RUNNING),
    *rows(_ENDED, Trigger.START_DOCKED, State.UNDOCKING),
    *rows(_MOVING, Trigger.PAUSE, State.PAUSED),
    *rows(_STANDING, Trigger.RESUME, State.RUNNING),
    *rows(_STANDING, Trigger.RESUME_DOCKING, State.DOCKING),
    *rows(_STANDING, Trigger.RESUME_UNDOCKING, State.UNDOCKING),
    *rows(_STANDING, Trigger.RESUME_DONE, State.COMPLETED),
    *rows(_STANDING, Trigger.RESUME_AWAITING, State.WAITING),
    *rows((*_MOVING, *_STANDING), Trigger.ABORT, State.ABORTED),
    *rows((*_MOVING, *_STANDING), Trigger.CANCEL, State.ABORTED),
    *rows((*_MOVING, State.PAUSED), Trigger.EMERGENCY_STOP, State.STOPPED),
    *rows((State.RUNNING,), Trigger.WAIT_HERE, State.WAITING),
    *rows((State.RUNNING,), Trigger.DOCK_HERE, State.DOCKING),
    *rows((State.RUNNING,), Trigger.UNDOCK_HERE, State.UNDOCKING),
    *rows(_MOVING, Trigger.NEXT, State.RUNNING),
    *rows(_MOVING, Trigger.DONE, State.COMPLETED),
    *rows(_MOVING, Trigger.AWAIT_PART, State.WAITING),
    *rows((State.WAITING,), Trigger.EXTENDED, State.RUNNING),
    *rows((State.RUNNING,), Trigger.TRY_FAILED, State.RUNNING),
    *rows((State.RUNNING,), Trigger.GAVE_UP, State.FAILED),
    *rows(_DOCKING, Trigger.DOCKING_FAILED, State.FAILED),
    *rows(_MOVING, Trigger.JOURNAL_LOST, State.PAUSED),
    *rows((State.IDLE,), Trigger.RESTORED, State.PAUSED),
    *rows((State.RUNNING, State.WAITING, State.PAUSED), Trigger.REPLACE, State.RUNNING),
    *rows((State.RUNNING, State.WAITING), Trigger.TO_SAFE_PLACE, State.RUNNING),
    *rows((State.RUNNING, State.DOCKING), Trigger.SAFE_PLACE, State.PAUSED),
    *rows((State.RUNNING, State.WAITING), Trigger.NO_SAFE_PLACE, State.PAUSED),
    *rows((State.RUNNING, State.WAITING), Trigger.LOST, State.PAUSED),
)

_TABLE = table_of(TRANSITIONS)


def target_of(state: State, trigger: Trigger) -> State | None:
    """The state that ``trigger`` leads to, None if it is not valid in ``state``."""
    return _TABLE.get((state, trigger))

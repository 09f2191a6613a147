"""The states of the navigation controller and their transitions.

The table is the only definition: the controller uses it, and the tests cover every row.
"""

from __future__ import annotations

from enum import Enum

from robot_stack.core.transitions import Transition, rows, table_of


class NavigationState(Enum):
    """State of the controller."""

    IDLE = "idle"  # no goal
    HELD = "held"  # a goal, but motion is forbidden
    DRIVING = "driving"  # the exact motion straight to the goal, clear of obstacles
    FOLLOWING = "following"  # a route among obstacles, or waiting until it is planned
    ARRIVING = "arriving"  # the last centimetres by feedback
    BRAKING = "braking"  # no goal, still moving


class Trigger(Enum):
    CLEAR = "the straight path to the goal is clear"
    OBSTRUCTED = "an obstacle is near the straight path to the goal"
    FORBIDDEN = "moving is forbidden or not possible"
    END_OF_PLAN = "end of the motion"
    REACHED = "within tolerance and standing"
    GAVE_UP = "no path for too long"
    WITHDRAWN = "goal cancelled or refused, nothing to brake"
    WITHDRAWN_MOVING = "goal cancelled or refused while moving"
    BRAKING_FORBIDDEN = "moving is forbidden without a goal"
    EMERGENCY_STOP = "emergency stop"


_S = NavigationState
_ANY = tuple(NavigationState)
_BUSY = tuple(state for state in NavigationState if state is not _S.IDLE)
_ON_THE_WAY = (_S.DRIVING, _S.FOLLOWING)

TRANSITIONS: tuple[Transition[NavigationState, Trigger], ...] = (
    # A goal may arrive in any state.
    *rows(_ANY, Trigger.CLEAR, _S.DRIVING),
    *rows(_ANY, Trigger.OBSTRUCTED, _S.FOLLOWING),
    *rows(_ANY, Trigger.FORBIDDEN, _S.HELD),
    *rows((_S.DRIVING,), Trigger.END_OF_PLAN, _S.ARRIVING),
    *rows((_S.BRAKING,), Trigger.END_OF_PLAN, _S.IDLE),
    *rows((_S.ARRIVING,), Trigger.REACHED, _S.IDLE),
    *rows((_S.FOLLOWING,), Trigger.GAVE_UP, _S.IDLE),
    *rows((_S.IDLE, _S.HELD, _S.ARRIVING, *_ON_THE_WAY), Trigger.WITHDRAWN, _S.IDLE),
    *rows(_ON_THE_WAY, Trigger.WITHDRAWN_MOVING, _S.BRAKING),
    *rows((_S.BRAKING,), Trigger.BRAKING_FORBIDDEN, _S.IDLE),
    *rows(_BUSY, Trigger.EMERGENCY_STOP, _S.IDLE),
)

_TABLE = table_of(TRANSITIONS)


def target_of(state: NavigationState, trigger: Trigger) -> NavigationState:
    """The state that ``trigger`` leads to. Raises KeyError for a trigger without a transition in ``state``."""
    return _TABLE[state, trigger]

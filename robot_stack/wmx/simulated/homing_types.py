"""The searches of each homing type.

A search runs in the homing direction or against it until an edge of the home switch; before the direction changes the
axis stops. Of the moving types the engine implements the one that the rising edge of the home switch ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from typing import Final

from robot_stack.wmx.api.enums import HomeState


class Limited(Enum):
    """The parameter that limits the distance of a search, and the error beyond it."""

    NOT = auto()
    HOME_ON_AT_START = auto()
    AFTER_LIMIT = auto()


@dataclass(frozen=True, slots=True)
class Search:
    """``rising``: the edge of the home switch that ends it. ``beyond``: after it the axis continues by
    homingReverseDistance.
    """

    state: HomeState
    rising: bool
    reverse: bool = False
    limited: Limited = Limited.NOT
    beyond: bool = False


HOME: Final = Search(HomeState.HSSearch, rising=True)
CLEAR_HOME_AT_START: Final = Search(
    HomeState.HSClearReverse, rising=False, reverse=True, limited=Limited.HOME_ON_AT_START
)
"""Before the search where the home switch is on already."""
BACK_FROM_LIMIT: Final = Search(
    HomeState.HSFallingEdgeSearchReverse, rising=False, reverse=True, limited=Limited.AFTER_LIMIT, beyond=True
)
"""After a limit switch during the search for the home switch; then the homing restarts."""

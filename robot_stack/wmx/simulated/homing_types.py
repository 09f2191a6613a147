"""What each home type looks for, step by step.

A search runs in the homing direction or against it, fast or slow, until a sensor says so. Two searches in the same
direction run into each other; before the direction changes the axis stops. The last one found is where home is.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from typing import Final

from robot_stack.wmx.api.enums import Config_HomeType, HomeState


class Until(Enum):
    """What ends a search."""

    HOME_ON = auto()  # the rising edge of the home switch
    HOME_OFF = auto()  # its falling edge
    LIMIT_ON = auto()  # the limit switch in the homing direction
    LIMIT_OFF = auto()
    Z_PULSE = auto()


class Limited(Enum):
    """Which parameter limits how far a search goes, and which error it is to go farther."""

    NOT = auto()
    HOME_ON_AT_START = auto()
    AFTER_LIMIT = auto()


@dataclass(frozen=True, slots=True)
class Search:
    """``beyond``: after it the axis goes on by homingReverseDistance."""

    state: HomeState
    until: Until
    reverse: bool = False
    slow: bool = False
    limited: Limited = Limited.NOT
    beyond: bool = False


_HOME = Search(HomeState.HSSearch, Until.HOME_ON)
_HOME_OFF = Search(HomeState.HSOffSearch, Until.HOME_OFF)
_LIMIT = Search(HomeState.LSSearch, Until.LIMIT_ON)
_Z = Search(HomeState.ZPulseSearch, Until.Z_PULSE, slow=True)
_Z_BACK = Search(HomeState.ZPulseSearchReverse, Until.Z_PULSE, reverse=True, slow=True)
_CLEAR_HOME = Search(HomeState.HSClearReverse, Until.HOME_OFF, reverse=True, beyond=True)
_SECOND_HOME = Search(HomeState.SecondHSSearch, Until.HOME_ON, slow=True)
_HOME_BACK = Search(HomeState.HSFallingEdgeSearchReverse, Until.HOME_ON, reverse=True, slow=True)

CLEAR_HOME_AT_START: Final = Search(
    HomeState.HSClearReverse, Until.HOME_OFF, reverse=True, limited=Limited.HOME_ON_AT_START
)
"""Before a search for the rising edge of a home switch that is on already."""
CLEAR_LIMIT_AT_START: Final = Search(HomeState.LSFallingEdgeSearchReverse, Until.LIMIT_OFF, reverse=True)
"""Before a search for a limit switch that is on already."""
BACK_FROM_LIMIT: Final = Search(
    HomeState.HSFallingEdgeSearchReverse, Until.HOME_OFF, reverse=True, limited=Limited.AFTER_LIMIT, beyond=True
)
"""After the limit switch came where the home switch was looked for; then the homing begins anew."""

SEARCHES: Final[dict[Config_HomeType, tuple[Search, ...]]] = {
    Config_HomeType.ZPulse: (_Z,),
    Config_HomeType.HS: (_HOME,),
    Config_HomeType.HSHS: (_HOME, _CLEAR_HOME, _SECOND_HOME),
    Config_HomeType.HSZPulse: (_HOME, _Z),
    Config_HomeType.HSReverseZPulse: (_HOME, _Z_BACK),
    Config_HomeType.HSOff: (_HOME_OFF,),
    Config_HomeType.HSOffZPulse: (_HOME_OFF, _Z),
    Config_HomeType.HSOffReverseZPulse: (_HOME_OFF, _HOME_BACK, _Z_BACK),
    Config_HomeType.LSReverseZPulse: (_LIMIT, _Z_BACK),
    Config_HomeType.LS: (_LIMIT,),
}
"""The home types that move. The others need inputs or a probe that no simulated drive has."""

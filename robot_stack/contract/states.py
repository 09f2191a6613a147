"""The states in messages: the documented values, each written once.

A state from the wire is a plain string, or a number, and equals its member. An undocumented one equals none of them.
"""

from enum import IntEnum, StrEnum


class DockingState(StrEnum):
    """``DockingStatus.state``. SERVOING also while the robot backs off from an opened latch."""

    IDLE = "IDLE"
    APPROACH = "APPROACH"  # to the staging pose, by navigation or backwards from a failed try
    SEARCH = "SEARCH"
    SERVOING = "SERVOING"
    FINE_ALIGN = "FINE_ALIGN"
    DOCKED = "DOCKED"  # at the dock pose; latching, latched or unlatching; at a station until clear of it
    FAILED = "FAILED"


class MissionState(StrEnum):
    """``MissionStatus.state``. The mission manager has more states, and shows each as one of these."""

    IDLE = "IDLE"
    RUNNING = "RUNNING"
    WAITING = "WAITING"
    PAUSED = "PAUSED"
    COMPLETED = "COMPLETED"
    ABORTED = "ABORTED"
    FAILED = "FAILED"


class HeldBy(IntEnum):
    """``MissionQueue.held_by``: why no order starts until a person releases the queue."""

    NOTHING = 0
    RESTART = 1
    STAFF = 2
    EMERGENCY_STOP = 3
    MISSION_ABORTED = 4
    MISSION_FAILED = 5
    PASSENGER = 6
    MANUAL = 7
    BATTERY_LOW = 8
    JOURNAL = 9
    LOCALIZATION_LOST = 10
    DOCKED = 11


class DoorMode(IntEnum):
    """``BuildingState.mode``; of ``BuildingRequest.mode`` CLOSED and OPEN."""

    CLOSED = 0
    MOVING = 1
    OPEN = 2
    OFFLINE = 3
    UNKNOWN = 4


class DoorPhase(IntEnum):
    """``BuildingRequest.phase``."""

    APPROACHING = 0
    WAITING = 1
    ASKING_STAFF = 2
    PASSING = 3
    LEFT = 4


DOOR_WAITS = frozenset({DoorPhase.WAITING, DoorPhase.ASKING_STAFF})
# The robot moves by the measured pose of a dock.
SERVOED = frozenset({DockingState.SERVOING, DockingState.FINE_ALIGN})
# The robot aims at the markers of a dock.
ALIGNING = SERVOED | {DockingState.SEARCH}
# A docking moves the robot.
DOCKING = ALIGNING | {DockingState.APPROACH}
# A mission is under way, or paused.
ACTIVE = frozenset({MissionState.RUNNING, MissionState.WAITING, MissionState.PAUSED})
# A mission has ended.
ENDED = frozenset({MissionState.COMPLETED, MissionState.ABORTED, MissionState.FAILED})

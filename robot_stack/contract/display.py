"""The states and languages of the external display."""

from enum import IntEnum

LANGUAGES = ("en", "ja", "zh")  # EHMIState.language, /ui/language


class Display(IntEnum):
    """EHMIState.state_num; 11 to 20 are reserved."""

    OFF = 0
    IDLE = 1
    NAVIGATING = 2
    PAUSED = 3
    CHARGING = 4
    ERROR = 5
    EMERGENCY_STOP = 6
    MANUAL = 7
    LOCALIZATION_LOST = 8
    LOW_BATTERY = 9
    OBSTACLE = 10
    APPROACHING_CHAIR = 21
    DOCKING = 22
    DOCKING_COMPLETE = 23
    PASSENGER_ONBOARD = 24
    TRANSPORT = 25
    DESTINATION_REACHED = 26
    PASSENGER_DISEMBARK = 27
    DOCKING_FAILED = 28

"""Results of docking and undocking. Codes as in Dock.action and Undock.action."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum


class DockCode(IntEnum):
    NONE = 0
    UNKNOWN_DOCK = 901
    INVALID_DOCK = 902
    STAGING_FAILED = 903
    MARKERS_NOT_FOUND = 904
    MARKERS_LOST = 905
    NOT_CONVERGED = 906
    LATCH_FAILED = 907
    TIMEOUT = 908
    SAFETY_STOP = 909
    CAMERA_TIMEOUT = 910
    LOCALIZATION_LOST = 911
    ALREADY_ATTACHED = 912
    BUSY = 913
    CANCELED = 914
    DOCK_MOVED = 915
    CONTACT = 916
    NOT_CHARGING = 917
    INTERNAL_ERROR = 999


class UndockCode(IntEnum):
    NONE = 0
    NOT_ATTACHED = 951
    ROBOT_MOVING = 952
    SLOPE_TOO_STEEP = 953
    UNLATCH_FAILED = 954
    BLOCKED = 955
    TIMEOUT = 956
    SAFETY_STOP = 957
    BUSY = 958
    CANCELED = 959
    INTERNAL_ERROR = 999


Code = DockCode | UndockCode


@dataclass(frozen=True, slots=True)
class Failure:
    """The reason of a failed try. final: another try would not help. elsewhere: another staging pose is used first."""

    code: Code
    reason: str
    final: bool = False
    elsewhere: bool = False


@dataclass(frozen=True, slots=True)
class Result:
    """The end of a docking or undocking. Errors NaN where unknown; distance_m backed off by an undocking."""

    code: Code
    reason: str = ""
    position_error_m: float = math.nan
    yaw_error_rad: float = math.nan
    tries: int = 0
    distance_m: float = 0.0

    @property
    def success(self) -> bool:
        return self.code == 0

"""Errors as VDA 5050 reports them (2.1.0, 6.10.5 and 7.1; 3.0.0, 6.6.5)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from robot_stack.fleet.version import Version

# Of a description: a hostile message must not make a large state.
_LONGEST = 300
_LONGEST_REFERENCE = 128  # an id


class Level(StrEnum):
    """URGENT and CRITICAL from 3.0 on."""

    WARNING = "WARNING"
    URGENT = "URGENT"
    CRITICAL = "CRITICAL"
    FATAL = "FATAL"


class ErrorType(StrEnum):
    """By their names of 3.0.0; those up to NO_ORDER_TO_CANCEL are predefined there (6.6.5.4 and 7.8)."""

    VALIDATION = "VALIDATION_FAILURE"
    UNSUPPORTED = "UNSUPPORTED_PARAMETER"
    ORDER_ACTION = "INVALID_ORDER_ACTION"
    INSTANT_ACTION = "INVALID_INSTANT_ACTION"
    MEMORY = "INSUFFICIENT_MEMORY"
    OTHER_ORDER = "OTHER_ORDER_ACTIVE"
    NOT_AVAILABLE = "MOBILE_ROBOT_NOT_AVAILABLE"
    UNKNOWN_MAP = "UNKNOWN_MAP_ID"
    START_NODE = "START_NODE_OUT_OF_RANGE"
    NO_ROUTE = "NO_ROUTE_TO_TARGET"
    ORDER_UPDATE = "INVALID_ORDER"
    OUTDATED_UPDATE = "OUTDATED_ORDER_UPDATE"
    SAME_UPDATE = "SAME_ORDER_UPDATE_ID"
    UPDATE_AFTER_CANCEL = "ORDER_UPDATE_FOLLOWING_CANCEL"
    UNREACHABLE = "NODE_UNREACHABLE"
    LOCALIZATION = "LOCALIZATION_ERROR"
    INSTANT_STATES_FULL = "INSTANT_ACTION_STATES_FULL"
    NO_ORDER_TO_CANCEL = "NO_ORDER_TO_CANCEL"
    ORDER_ABORTED = "ORDER_ABORTED"
    OVERLOAD = "OVERLOAD"
    SAFETY_UNKNOWN = "SAFETY_UNKNOWN"
    BATTERY_UNKNOWN = "BATTERY_UNKNOWN"
    MISSIONS_UNKNOWN = "MISSION_MANAGER_UNKNOWN"


# In 2.1.0, which predefines validationError, orderError, orderUpdateError (6.6.4) and noOrderToCancel (6.6.3.2).
_NAMES_V2: Final[dict[str, str]] = {
    ErrorType.VALIDATION: "validationError",
    ErrorType.UNSUPPORTED: "orderError",
    ErrorType.ORDER_ACTION: "orderError",
    ErrorType.INSTANT_ACTION: "instantActionError",
    ErrorType.MEMORY: "orderError",
    ErrorType.OTHER_ORDER: "orderError",
    ErrorType.NOT_AVAILABLE: "orderError",
    ErrorType.UNKNOWN_MAP: "orderError",
    ErrorType.START_NODE: "noRouteError",
    ErrorType.NO_ROUTE: "orderError",
    ErrorType.ORDER_UPDATE: "orderUpdateError",
    ErrorType.OUTDATED_UPDATE: "orderUpdateError",
    ErrorType.UPDATE_AFTER_CANCEL: "orderUpdateError",
    ErrorType.NO_ORDER_TO_CANCEL: "noOrderToCancel",
    ErrorType.ORDER_ABORTED: "orderAborted",
    ErrorType.OVERLOAD: "overload",
    ErrorType.SAFETY_UNKNOWN: "safetyUnknown",
    ErrorType.BATTERY_UNKNOWN: "batteryUnknown",
    ErrorType.MISSIONS_UNKNOWN: "missionManagerUnknown",
}
_LEVELS_V3: Final[dict[str, Level]] = {
    ErrorType.UNSUPPORTED: Level.CRITICAL,
    ErrorType.UNREACHABLE: Level.CRITICAL,
    ErrorType.MEMORY: Level.URGENT,
    ErrorType.INSTANT_STATES_FULL: Level.URGENT,
}


def name_of(kind: str, version: Version) -> str:
    """``errorType`` of an ErrorType, or of a fault code."""
    return str(_NAMES_V2.get(kind, kind)) if version is Version.V2 else str(kind)


@dataclass(frozen=True, slots=True)
class Error:
    """One entry of ``state.errors``. references: (referenceKey, referenceValue)."""

    type: str
    description: str
    references: tuple[tuple[str, str], ...] = ()
    hint: str = ""
    level: Level = Level.WARNING

    def data(self, version: Version) -> dict[str, object]:
        level = self.level if version is Version.V2 else _LEVELS_V3.get(self.type, self.level)
        entry: dict[str, object] = {
            "errorType": name_of(self.type, version),
            "errorLevel": level.value,
            "errorDescription": shortened(self.description),
            "errorReferences": [
                {
                    "referenceKey": shortened(key, _LONGEST_REFERENCE),
                    "referenceValue": shortened(value, _LONGEST_REFERENCE),
                }
                for key, value in self.references
            ],
        }
        return entry | ({"errorHint": self.hint} if self.hint else {})


def shortened(text: str, longest: int = _LONGEST) -> str:
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


class Refused(Exception):
    """A message or an action is not carried out."""

    def __init__(self, error: Error) -> None:
        super().__init__(error.description)
        self.error = error

"""Errors as VDA 5050 reports them (2.1.0, 6.10.5 and 7.1)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

# Of a description: a hostile message must not make a large state.
_LONGEST = 300
_LONGEST_REFERENCE = 128  # an id


class Level(StrEnum):
    WARNING = "WARNING"
    FATAL = "FATAL"


class ErrorType(StrEnum):
    """The first three are the specification's (2.1.0, 6.6.4), noOrderToCancel too (6.6.3.2)."""

    VALIDATION = "validationError"
    ORDER = "orderError"
    ORDER_UPDATE = "orderUpdateError"
    NO_ORDER_TO_CANCEL = "noOrderToCancel"
    NO_ROUTE = "noRouteError"
    INSTANT_ACTION = "instantActionError"
    ORDER_ABORTED = "orderAborted"
    OVERLOAD = "overload"
    SAFETY_UNKNOWN = "safetyUnknown"
    BATTERY_UNKNOWN = "batteryUnknown"
    MISSIONS_UNKNOWN = "missionManagerUnknown"


@dataclass(frozen=True, slots=True)
class Error:
    """One entry of ``state.errors``. references: (referenceKey, referenceValue)."""

    type: str
    description: str
    references: tuple[tuple[str, str], ...] = ()
    hint: str = ""
    level: Level = Level.WARNING

    def data(self) -> dict[str, object]:
        entry: dict[str, object] = {
            "errorType": self.type,
            "errorLevel": self.level.value,
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

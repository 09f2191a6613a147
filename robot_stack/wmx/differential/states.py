"""Where the session with the engine stands, and what it is told at its start."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from robot_stack.wmx.axes import StatusSnapshot


class Stage(Enum):
    """How far the session is."""

    CONNECTING = "connecting"
    COMMUNICATION = "starting communication"
    PARAMETERS = "setting parameters"
    STOPPED = "emergency stop"
    FAULT = "fault"
    SWITCHING_ON = "switching on"
    STOPPING = "stopping"
    READY = "ready"


@dataclass(frozen=True, slots=True)
class SessionSettings:
    """left_axis, right_axis: of the engine. acc_time_s, dec_time_s: how long a change of velocity takes.
    parameter_file: the engine's parameter XML, empty for none.

    communication_retry_s, request_pause_s: between repetitions of a request that has not been fulfilled. follow_s: so
    long after a command a wheel must be in velocity motion. standstill_radps: a slower wheel stands.
    """

    left_axis: int
    right_axis: int
    acc_time_s: float
    dec_time_s: float
    parameter_file: str
    communication_retry_s: float
    request_pause_s: float
    follow_s: float
    standstill_radps: float

    @property
    def axes(self) -> tuple[int, int]:
        return self.left_axis, self.right_axis


@dataclass(frozen=True, slots=True)
class SessionState:
    """snapshot: the engine's present status, None while there is none that can be trusted."""

    stage: Stage
    text: str
    snapshot: StatusSnapshot | None = None

"""Stages of the session with the engine, and what it is told at its start."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


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
    long after a command a wheel must be in velocity motion, and so old may the status be that a command is made of,
    both in the engine's time. standstill_radps: a slower wheel stands. command_lifetime_s: the engine itself stops
    wheels that get no other command for so long.
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
    command_lifetime_s: float

    @property
    def axes(self) -> tuple[int, int]:
        return self.left_axis, self.right_axis

"""Settings of the session with the engine."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SessionSettings:
    """left_axis, right_axis: of the engine. acc_time_s, dec_time_s: how long a change of velocity takes.
    parameter_file: the engine's parameter XML, empty for none.

    communication_retry_s, request_pause_s: between repetitions of an unfulfilled request. follow_s: time after
    a command in which a wheel must reach velocity motion, and largest age of the status for a command,
    both in the engine's time. standstill_radps: a slower wheel stands. command_lifetime_s: timeout after which the
    engine itself stops wheels without a new command.
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

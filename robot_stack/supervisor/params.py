"""Tuning of the supervisor, ``config/supervisor.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.contract.model import Criticality
from robot_stack.contract.processes import BY_NAME
from robot_stack.core.config import Config, Positive, load


class Backoff(Config):
    """Waiting time before a restart: first_s, then factor times longer at each further crash, at most longest_s."""

    first_s: Positive
    factor: Annotated[float, Field(ge=1.0)]
    longest_s: Positive


class SupervisorParams(Config):
    """hang_after_s: a process that has been ready and is silent for this long is hung.
    construction_limit_s: the same before it has been ready for the first time.
    start_at_once: largest number of processes before their first heartbeat when another is started for the first time.
    stable_after_s: a process that ran this long resets its back-off.
    interrupt_s, terminate_s: after SIGINT at 0, the times at which ``down`` sends SIGTERM and SIGKILL.
    hung_kill_s: time a hung process has between SIGTERM and SIGKILL.
    keep_runs: log folders kept; older ones are deleted at the next start.
    niceness: of the processes by criticality, as in nice(2); below 0 needs a privilege and is left out without it.
    own_niceness: of the supervisor itself: a starved supervisor takes live processes for hung.
    realtime_priority: by process, of SCHED_RR; others have none. Left out without the privilege.
    lock_memory: by criticality: its pages stay in memory, as in mlockall(2). Left out without the privilege.
    """

    hang_after_s: Positive
    construction_limit_s: Positive
    start_at_once: Annotated[int, Field(ge=1)]
    stable_after_s: Positive
    interrupt_s: Positive
    terminate_s: Positive
    hung_kill_s: Positive
    keep_runs: Annotated[int, Field(ge=1)]
    niceness: dict[Criticality, Annotated[int, Field(ge=-20, le=19)]]
    own_niceness: Annotated[int, Field(ge=-20, le=19)]
    realtime_priority: dict[str, Annotated[int, Field(ge=1, le=99)]]
    lock_memory: dict[Criticality, bool]
    backoff: dict[Criticality, Backoff]

    @model_validator(mode="after")
    def _complete(self) -> SupervisorParams:
        for name in ("backoff", "niceness", "lock_memory"):
            absent = [item.value for item in Criticality if item not in getattr(self, name)]
            if absent:
                raise ValueError(f"{name}: {', '.join(absent)} missing")
        strangers = sorted(self.realtime_priority.keys() - BY_NAME.keys())
        if strangers:
            raise ValueError(f"realtime_priority: {', '.join(strangers)} is no process of the stack")
        if self.terminate_s <= self.interrupt_s:
            raise ValueError("terminate_s must be greater than interrupt_s")
        return self


def load_params() -> SupervisorParams:
    """Raises ConfigError."""
    return load(SupervisorParams, "supervisor")

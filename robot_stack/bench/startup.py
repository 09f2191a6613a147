"""Time from `robot-stack up` to every node ready, and from `down` to nothing left."""

from __future__ import annotations

import statistics
import time

from robot_stack.bench.commands import robot_stack
from robot_stack.bench.framework import Aim, BenchError, Result
from robot_stack.supervisor.control import NotRunning, ask

NAME = "startup"
AIMS = {"ready_s_median": Aim("<", 5.0)}


def run(runs: int = 5, profile: str = "sim") -> Result:
    """The whole commands are timed, start of the interpreter included. Raises BenchError if the stack stays down."""
    up_s, down_s, own_s = [], [], []
    processes = 0
    for _ in range(runs):
        up_s.append(_timed("up", "--profile", profile))
        try:
            status = ask("status")
        except NotRunning as error:
            raise BenchError("the stack has gone right after `up`") from error
        own_s.append(status["ready_after_s"])
        processes = len(status["processes"])
        down_s.append(_timed("down"))
    return Result(
        {
            "ready_s_median": statistics.median(up_s),
            "ready_s_max": max(up_s),
            "supervisor_ready_s_median": statistics.median(own_s),
            "down_s_median": statistics.median(down_s),
            "runs": runs,
        },
        {"profile": profile, "processes": processes, "ready_s": [round(value, 2) for value in up_s]},
    )


def _timed(*arguments: str) -> float:
    begun_s = time.monotonic()
    robot_stack(*arguments)
    return time.monotonic() - begun_s

"""Time from `robot-stack up` to every node ready, warm, cold and on a busy machine; from `down` to nothing left."""

from __future__ import annotations

import os
import shutil
import statistics
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from robot_stack.supervisor.control import NotRunning, ask
from tests.benchmarks.support.commands import robot_stack
from tests.benchmarks.support.framework import Aim, BenchError, Result
from tests.benchmarks.support.stack import busy_loops

AIMS = {
    "ready_s_median": Aim("<", 4.0),
    "first_ready_s": Aim("<", 8.0),
    "cold_ready_s": Aim("<", 120.0),
    "loaded_ready_s": Aim("<", 12.0),
    "down_s_median": Aim("<", 2.0),
    "restarts": Aim("<=", 0),
}
_BUSY = 4
# Prefix that reduces a command's rights to those of an ordinary user.
_NO_RIGHTS = ("setpriv", "--inh-caps=-all", "--bounding-set=-all", "--no-new-privs")


@dataclass(frozen=True, slots=True)
class _Start:
    """up_s, down_s: of the whole commands, start of the interpreter included. own_s: by the supervisor's count."""

    up_s: float
    own_s: float
    down_s: float
    processes: int
    restarts: int


def run(runs: int = 5, profile: str = "sim", cold: bool = True) -> Result:
    """first_ready_s is the first of the runs: relevant right after set-up in a fresh clone.

    cold_ready_s: with an empty cache of compiled loops (cold=false omits it). loaded_ready_s: beside four
    busy loops, without real-time or other rights. restarts: of all processes in all runs.
    Raises BenchError if the stack stays down.
    """
    starts = [_start(profile) for _ in range(runs)]
    with busy_loops(_BUSY):
        loaded = _start(profile, before=_without_rights())
    others = [loaded]
    figures = {
        "ready_s_median": statistics.median(item.up_s for item in starts),
        "ready_s_max": max(item.up_s for item in starts),
        "supervisor_ready_s_median": statistics.median(item.own_s for item in starts),
        "first_ready_s": starts[0].up_s,
        "loaded_ready_s": loaded.up_s,
        "down_s_median": statistics.median(item.down_s for item in starts),
    }
    if cold:
        with tempfile.TemporaryDirectory() as cache:
            others.append(_start(profile, environment={"NUMBA_CACHE_DIR": cache}))
        figures["cold_ready_s"] = others[-1].up_s
    return Result(
        {**figures, "restarts": sum(item.restarts for item in (*starts, *others)), "runs": runs},
        {
            "profile": profile,
            "processes": starts[0].processes,
            "ready_s": [round(item.up_s, 2) for item in starts],
            "rights_of_the_loaded_run": "none" if _without_rights() or os.getuid() else "all: setpriv is missing",
        },
    )


def _start(profile: str, before: Sequence[str] = (), environment: Mapping[str, str] | None = None) -> _Start:
    begun_s = time.monotonic()
    robot_stack("up", "--profile", profile, before=before, environment=environment)
    up_s = time.monotonic() - begun_s
    try:
        status = ask("status")
    except NotRunning as error:
        raise BenchError("the stack ended right after `up`") from error
    begun_s = time.monotonic()
    robot_stack("down")
    down_s = time.monotonic() - begun_s
    restarts = sum(item["restarts"] for item in status["processes"])
    return _Start(up_s, status["ready_after_s"], down_s, len(status["processes"]), restarts)


def _without_rights() -> tuple[str, ...]:
    """Prefix that drops root's rights; empty without root."""
    if os.getuid() or shutil.which(_NO_RIGHTS[0]) is None:
        return ()
    # Real-time priority, niceness below 0, locked memory.
    return (*_NO_RIGHTS, "bash", "-c", 'ulimit -r 0; ulimit -e 0; ulimit -l 0; exec "$@"', "up")

"""The safety lines of `up` after the start: an earlier emergency is still latched and must be reported."""

from __future__ import annotations

import contextlib
import time
from typing import Any

from robot_stack.contract.faults import BY_CODE
from robot_stack.contract.model import Clears
from robot_stack.supervisor.control import NotRunning, ask

_POLL_S = 0.05


def settled_safety(deadline_s: float) -> dict[str, Any] | None:
    """The supervisor's safety status once it is normal or latched, else at the deadline, because some inputs are
    missing right after a start. None without a status until then.
    """
    end_s = time.monotonic() + deadline_s
    safety: dict[str, Any] | None = None
    while True:
        with contextlib.suppress(NotRunning, TimeoutError):
            safety = ask("safety").get("safety")
        if safety is not None and (safety["emergency"] or not safety["faults"]):
            return safety
        if time.monotonic() > end_s:
            return safety
        time.sleep(_POLL_S)


def safety_lines(safety: dict[str, Any] | None) -> list[str]:
    """The state, and if the robot must not move: the cause and its release."""
    if safety is None:
        return ["safety: no status of the safety monitor"]
    faults = list(safety["faults"])
    if not safety["emergency"]:
        passing = f": {', '.join(faults)}; clears when the cause is gone" if faults else ""
        return [f"safety: {safety['state']}{passing}"]
    return [
        f"safety: {safety['state']}: the robot does not move",
        *(f"  {_described(code)}" for code in faults),
        "  `robot-stack reset` releases it, once no stop button is pressed and the causes are gone",
    ]


def _described(code: str) -> str:
    row = BY_CODE.get(code)
    if row is None:
        return code
    return f"{code}: {row.raised_when}{' (latched)' if row.clears is Clears.ON_RESET else ''}"

"""Braking time of a drive axis, computed from engine status samples that may arrive late."""

from __future__ import annotations

from collections.abc import Callable

from robot_stack.wmx.axes import StatusSnapshot

WaitStatus = Callable[[Callable[[StatusSnapshot], object], str], object]


def braking_s(wait_status: WaitStatus, axis: int, from_radps: float) -> float:
    """Time from ``from_radps`` to standstill [s], extrapolated from the slope of the observed samples."""
    seen: dict[float, float] = {}

    def stands(snapshot: StatusSnapshot) -> bool:
        seen[snapshot.engine_time_s] = float(snapshot.velocity_cmd[axis])
        return not snapshot.velocity_cmd[axis]

    wait_status(stands, "standstill")
    ramp = [(at_s, radps) for at_s, radps in seen.items() if 0.0 < radps < 0.999 * from_radps]
    (start_s, fast_radps), (end_s, slow_radps) = ramp[0], ramp[-1]
    return from_radps * (end_s - start_s) / (fast_radps - slow_radps)

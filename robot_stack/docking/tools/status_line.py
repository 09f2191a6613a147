"""``/docking/status`` in one line."""

from __future__ import annotations

import math

from robot_stack.contract.states import DockingState


def describe(state: str, error_m: float, yaw_rad: float, visible: int, progress: float) -> str:
    """Unknown values are left out."""
    parts = [state]
    if math.isfinite(error_m):
        parts.append(f"{1000.0 * error_m:.1f} mm")
    if math.isfinite(yaw_rad):
        parts.append(f"{math.degrees(yaw_rad):+.2f} deg")
    parts.append("1 marker" if visible == 1 else f"{visible} markers")
    if math.isfinite(progress) and state not in (DockingState.IDLE, DockingState.FAILED):
        parts.append(f"{progress:.0%}")
    return ", ".join(parts)


def silent(age_s: float) -> str:
    return f"no /docking/status for {age_s:.0f} s"

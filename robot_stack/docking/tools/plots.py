"""The course of a docking as a picture: errors, markers, speed and effort over time, on bands of the states."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from robot_stack.contract.states import DockingState
from robot_stack.docking.tools.trace import Trace
from robot_stack.docking.tools.verdict import Limits

_BANDS: dict[str, str] = {
    DockingState.APPROACH: "#dfe7f2",
    DockingState.SEARCH: "#fbe9c6",
    DockingState.SERVOING: "#d8ecd9",
    DockingState.FINE_ALIGN: "#b9dcc0",
    DockingState.DOCKED: "#c9c3e6",
}
_LINE, _OTHER, _LIMIT = "#1f5fbf", "#e08a00", "#b3261e"
# A logarithmic axis has no zero.
_LEAST_MM, _LEAST_DEG = 1e-2, 1e-3


def course(trace: Trace, limits: Limits, title: str) -> Figure:
    """The figure; times in s since the docking's start."""
    figure = Figure(figsize=(11.0, 12.0), layout="constrained")
    axes = figure.subplots(5, 1, sharex=True, height_ratios=(1.3, 1.0, 1.0, 1.0, 0.7))
    figure.suptitle(title, fontsize=10, wrap=True)
    _errors(axes[0], axes[1], trace, limits)
    _markers(axes[2], trace)
    _speeds(axes[3], trace)
    _effort(axes[4], trace)
    for number, each in enumerate(axes):
        _bands(each, trace, labelled=number == 0)
        each.grid(alpha=0.3)
    axes[-1].set_xlabel("s since the docking began")
    axes[-1].set_xlim(0.0, max(0.1, trace.end_s - trace.start_s + 0.5))
    return figure


def _bands(axes: Any, trace: Trace, labelled: bool) -> None:
    for spell in trace.states():
        begin, end = spell.start_s - trace.start_s, spell.end_s - trace.start_s
        axes.axvspan(begin, end, color=_BANDS.get(spell.value, "#eeeeee"), zorder=0, linewidth=0.0)
        if labelled:
            place = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "bottom"}
            axes.annotate(spell.value, (0.5 * (begin + end), 1.02), fontsize=7, rotation=20, **place)


def _errors(position: Any, yaw: Any, trace: Trace, limits: Limits) -> None:
    times = [item.at_s - trace.start_s for item in trace.statuses]
    # NaN leaves a gap in the line.
    position.plot(times, [max(1000.0 * item.error_m, _LEAST_MM) for item in trace.statuses], color=_LINE)
    position.axhline(1000.0 * limits.aligned_m, color=_LIMIT, linewidth=0.8, linestyle="--")
    yaw.plot(times, [max(abs(math.degrees(item.yaw_rad)), _LEAST_DEG) for item in trace.statuses], color=_LINE)
    yaw.axhline(math.degrees(limits.aligned_rad), color=_LIMIT, linewidth=0.8, linestyle="--")
    for axes, label in ((position, "position error, mm"), (yaw, "|yaw error|, deg")):
        axes.set_yscale("log")
        axes.set_ylabel(label)


def _markers(axes: Any, trace: Trace) -> None:
    times = [item.at_s - trace.start_s for item in trace.statuses]
    axes.step(times, [item.visible for item in trace.statuses], where="post", color=_LINE, label="visible markers")
    axes.set_ylabel("visible markers")
    axes.set_ylim(bottom=0.0)
    quality = axes.twinx()
    quality.set_ylabel("quality")
    quality.set_ylim(0.0, 1.05)
    for number in sorted({marker.marker_id for marker in trace.markers}):
        mine = [marker for marker in trace.markers if marker.marker_id == number]
        at = [marker.at_s - trace.start_s for marker in mine]
        quality.plot(at, [marker.quality for marker in mine], ".", markersize=3, label=f"marker {number}")
    if trace.markers:
        quality.legend(fontsize=7, loc="lower left")


def _speeds(axes: Any, trace: Trace) -> None:
    for items, colour, name in ((trace.driven, _LINE, "odometry"), (trace.commanded, _OTHER, "commanded")):
        times = [item.at_s - trace.start_s for item in items]
        axes.plot(times, [np.hypot(item.vx_mps, item.vy_mps) for item in items], color=colour, label=f"{name}, m/s")
        turning = [item.yaw_rate_radps for item in items]
        axes.plot(times, turning, color=colour, linewidth=0.8, linestyle=":", label=f"{name}, rad/s")
    limits = [item for item in trace.limits if math.isfinite(item.linear_mps)]
    if limits:
        times = [max(0.0, item.at_s - trace.start_s) for item in limits] + [trace.end_s - trace.start_s]
        values = [item.linear_mps for item in limits]
        axes.step(times, [*values, values[-1]], where="post", color=_LIMIT, linewidth=0.8, label="speed limit, m/s")
    axes.set_ylabel("speed")
    # The robot docks at 0.15 m/s; a limit far above it would hide that.
    most = max((abs(value) for item in (*trace.driven, *trace.commanded) for value in _parts(item)), default=0.1)
    axes.set_ylim(-1.2 * max(most, 0.05), 1.2 * max(most, 0.05))
    axes.legend(fontsize=7, loc="upper right")


def _parts(item: Any) -> tuple[float, float]:
    return math.hypot(item.vx_mps, item.vy_mps), item.yaw_rate_radps


def _effort(axes: Any, trace: Trace) -> None:
    axes.plot(
        [item.at_s - trace.start_s for item in trace.efforts], [item.largest_nm for item in trace.efforts], color=_LINE
    )
    axes.set_ylabel("largest effort, Nm")

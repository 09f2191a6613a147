"""Pictures of `robot-stack report`."""

from __future__ import annotations

from io import BytesIO

import numpy as np

from robot_stack.cli.map_picture import draw_grid
from robot_stack.core.rides import RideRecord
from robot_stack.core.site_map import Grid

_DRIVEN, _STOPPED = "#1f5fbf", "#b3261e"
_MARGIN_M = 4.0
_DPI = 110


def ride_picture(ride: RideRecord, grid: Grid | None) -> bytes:
    """The route on the map with its numbered stops, and the speed over time, as a PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 8.0), layout="constrained")
    site, course = figure.subplots(2, 1, height_ratios=(3.0, 1.0))
    way = np.array([(point.x, point.y) for point in ride.path]).reshape(-1, 2)
    if grid is not None:
        draw_grid(site, grid)
    site.plot(way[:, 0], way[:, 1], color=_DRIVEN, linewidth=1.8)
    for number, stop in enumerate(ride.stops, start=1):
        if stop.x is None or stop.y is None:
            continue
        site.plot(stop.x, stop.y, "o", color=_STOPPED, markersize=11.0)
        site.annotate(str(number), (stop.x, stop.y), color="white", fontsize=7, ha="center", va="center")
    if len(way):
        low, high = way.min(axis=0) - _MARGIN_M, way.max(axis=0) + _MARGIN_M
        site.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    site.set(xlabel="x in map / m", ylabel="y in map / m", aspect="equal")
    for stop in ride.stops:
        course.axvspan(stop.begin_s, stop.begin_s + stop.duration_s, color=_STOPPED, alpha=0.15, linewidth=0.0)
    course.plot([point.at_s for point in ride.path], [point.speed_mps for point in ride.path], color=_DRIVEN)
    course.set(xlabel="time / s", ylabel="speed / m/s", xlim=(0.0, max(ride.duration_s, 1.0)))
    course.grid(alpha=0.3)
    written = BytesIO()
    figure.savefig(written, format="png", dpi=_DPI)
    return written.getvalue()

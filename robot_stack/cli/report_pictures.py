"""Pictures of `robot-stack report`."""

from __future__ import annotations

import time
from collections.abc import Sequence
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from robot_stack.cli.map_picture import draw_grid
from robot_stack.core.kept_events import EventRecord
from robot_stack.core.rides import RideRecord
from robot_stack.core.site_map import Grid

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DRIVEN, _STOPPED = "#1f5fbf", "#b3261e"
_MARGIN_M = 4.0
_DPI = 110
_TICKS_S, _MOST_TICKS = (60, 300, 600, 1800, 3600, 7200, 14_400, 86_400, 10**9), 10


def battery_picture(rides: Sequence[RideRecord], events: Sequence[EventRecord]) -> bytes | None:
    """The battery's charge in local time, dotted between rides, with the events. None if it is unknown."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, MultipleLocator

    courses = [course for ride in rides if (course := _charges(ride))]
    if not courses:
        return None
    figure = Figure(figsize=(10.0, 2.6), layout="constrained")
    axes = figure.add_subplot()
    joined = [point for course in courses for point in course]
    axes.plot(*zip(*joined, strict=True), color=_DRIVEN, linewidth=1.0, linestyle=":")
    for course in courses:
        axes.plot(*zip(*course, strict=True), color=_DRIVEN, linewidth=2.0)
    for event in events:
        axes.axvline(event.at_s, color=_STOPPED, linewidth=1.0)
    axes.set(ylabel="battery / %", ylim=(0.0, 100.0))
    low_s, high_s = axes.get_xlim()
    axes.xaxis.set_major_locator(MultipleLocator(next(s for s in _TICKS_S if high_s - low_s <= _MOST_TICKS * s)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda at_s, _: time.strftime("%H:%M", time.localtime(at_s))))
    axes.grid(alpha=0.3)
    return _png(figure)


def _charges(ride: RideRecord) -> list[tuple[float, float]]:
    """s since the epoch and %."""
    last = ride.battery[1]
    course = [(ride.began_s + item.at_s, item.charge) for item in ride.charges]
    course += [] if last is None else [(ride.began_s + ride.duration_s, last)]
    return [(at_s, 100.0 * charge) for at_s, charge in course]


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
    return _png(figure)


def _png(figure: Figure) -> bytes:
    written = BytesIO()
    figure.savefig(written, format="png", dpi=_DPI)
    return written.getvalue()

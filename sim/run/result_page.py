"""The result page of a demonstration: way, duration, accuracy, and stops with their reasons."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

from robot_stack.cli.html_page import figures, millimetres, page, seconds, state_line, table
from sim.run.ride import Carriage, Figures, Stop


@dataclass(frozen=True, slots=True)
class Result:
    """Contents of the page. carried: None without a wheelchair.

    arrivals: waypoint and time in s. touched: what robot or wheelchair touched.
    """

    mission: str
    world: str
    seed: int
    state: str
    reason: str
    figures: Figures
    carried: Carriage | None
    arrivals: Sequence[tuple[str, float]]
    stops: Sequence[Stop]
    touched: Sequence[str]


def result_page(result: Result, film: str) -> str:
    """HTML that names map.png, course.png and the film beside it; it needs nothing else. film: empty without one."""
    parts = [
        f"<h1>{escape(result.mission)}</h1>",
        state_line(result.state, f"{result.reason} in the simulated world {result.world}, seed {result.seed}"),
        figures(_figures(result)),
        '<h2>Route</h2><img src="map.png" alt="Map with the plan, the driven path, the waypoints and the stops">',
        *([f'<h2>Film</h2><img src="{escape(film)}" alt="The ride, drawn from its recording">'] if film else []),
        "<h2>Speed, deviation from the plan, error of the estimated pose</h2>",
        '<img src="course.png" alt="Three plots over time">',
        *table("Stops", ("", "from", "for", "where", "why"), map(_stop_row, range(1, 10**4), result.stops)),
        *table("Waypoints", ("", "done after"), ((name, seconds(time_s)) for name, time_s in result.arrivals)),
        "<p>Times are the world's. The recording for Foxglove and rosbag2 is the folder recording.</p>",
    ]
    return page(result.mission, parts)


def _figures(result: Result) -> Iterable[tuple[str, str]]:
    found, carried = result.figures, result.carried
    yield (f"{found.distance_m:.1f} m", "driven")
    yield (seconds(found.time_s), "from start to end")
    yield (f"{found.top_speed_mps:.2f} m/s", "top speed")
    yield (millimetres(found.final_error_m, found.final_error_deg), "off the goal")
    yield (millimetres(found.tracking_rms_m), "off the plan, rms")
    yield (millimetres(found.estimate_p95_m, found.estimate_p95_deg), "error of the estimated pose, p95")
    if carried is not None and math.isfinite(carried.docked_mm):
        yield (f"{carried.docked_mm:.1f} mm, {carried.docked_deg:.2f}°", "docking error before the latch closed")
        yield (f"{carried.carried_m:.1f} m", "wheelchair carried")
    if carried is not None and math.isfinite(carried.beside_m):
        yield (millimetres(carried.beside_m, carried.beside_deg), "wheelchair beside its place at the end")
    stood_s = sum(stop.duration_s for stop in result.stops)
    yield (f"{len(result.stops)}, {seconds(stood_s)}", "stops, and all of them together")
    yield (", ".join(result.touched) or "nothing", "touched")


def _stop_row(number: int, stop: Stop) -> tuple[str, ...]:
    where = f"x {stop.pose.x:.1f} m, y {stop.pose.y:.1f} m"
    return str(number), seconds(stop.time_s), seconds(stop.duration_s), where, stop.why

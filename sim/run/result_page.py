"""The result page of a demonstration: way, duration, accuracy, and stops with their reasons."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

from sim.run.ride import Carriage, Figures, Stop

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #12212b; background: #f4f6f7; margin: 0 auto;
  max-width: 70rem; padding: 1.5rem; }
h1 { margin: 0 0 .2rem; } h2 { margin: 2rem 0 .5rem; }
.state { padding: .2rem .8rem; border-radius: 1rem; color: #fff; font-weight: 700; background: #9b1116; }
.state.COMPLETED { background: #1d6b36; }
.figures { display: grid; grid-template-columns: repeat(auto-fill, minmax(14rem, 1fr)); gap: .8rem; margin: 1rem 0; }
.figures div { background: #fff; border: 1px solid #a9b6be; border-radius: .5rem; padding: .6rem .9rem; }
.figures b { display: block; font-size: 1.4rem; } .figures span { color: #33454f; }
img { max-width: 100%; border: 1px solid #a9b6be; border-radius: .5rem; background: #fff; }
table { border-collapse: collapse; width: 100%; background: #fff; }
th, td { text-align: left; padding: .35rem .7rem; border-bottom: 1px solid #d7dee2; }
"""


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
        "<!doctype html>",
        f'<html lang="en"><head><meta charset="utf-8"><title>{escape(result.mission)}</title>',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<style>{_STYLE}</style></head><body>",
        f"<h1>{escape(result.mission)}</h1>",
        f'<p><span class="state {escape(result.state)}">{escape(result.state)}</span> {escape(result.reason)}',
        f"in the simulated world {escape(result.world)}, seed {result.seed}</p>",
        f'<div class="figures">{"".join(_figures(result))}</div>',
        '<h2>Route</h2><img src="map.png" alt="Map with the plan, the driven path, the waypoints and the stops">',
        *([f'<h2>Film</h2><img src="{escape(film)}" alt="The ride, drawn from its recording">'] if film else []),
        "<h2>Speed, deviation from the plan, error of the estimated pose</h2>",
        '<img src="course.png" alt="Three plots over time">',
        *_table("Stops", ("", "from", "for", "where", "why"), map(_stop_row, range(1, 10**4), result.stops)),
        *_table("Waypoints", ("", "done after"), ((name, _seconds(time_s)) for name, time_s in result.arrivals)),
        "<p>Times are the world's. The recording for Foxglove and rosbag2 is the folder recording.</p>",
        "</body></html>",
        "",
    ]
    return "\n".join(parts)


def _figures(result: Result) -> Iterable[str]:
    found, carried = result.figures, result.carried
    yield _figure(f"{found.distance_m:.1f} m", "driven")
    yield _figure(_seconds(found.time_s), "from start to end")
    yield _figure(f"{found.top_speed_mps:.2f} m/s", "top speed")
    yield _figure(_millimetres(found.final_error_m, found.final_error_deg), "off the goal")
    yield _figure(_millimetres(found.tracking_rms_m), "off the plan, rms")
    yield _figure(_millimetres(found.estimate_p95_m, found.estimate_p95_deg), "error of the estimated pose, p95")
    if carried is not None and math.isfinite(carried.docked_mm):
        yield _figure(f"{carried.docked_mm:.1f} mm, {carried.docked_deg:.2f}°", "docking error before the latch closed")
        yield _figure(f"{carried.carried_m:.1f} m", "wheelchair carried")
    if carried is not None and math.isfinite(carried.beside_m):
        yield _figure(_millimetres(carried.beside_m, carried.beside_deg), "wheelchair beside its place at the end")
    stood_s = sum(stop.duration_s for stop in result.stops)
    yield _figure(f"{len(result.stops)}, {_seconds(stood_s)}", "stops, and all of them together")
    yield _figure(", ".join(result.touched) or "nothing", "touched")


def _figure(value: str, name: str) -> str:
    return f"<div><b>{escape(value)}</b><span>{escape(name)}</span></div>"


def _stop_row(number: int, stop: Stop) -> tuple[str, ...]:
    where = f"x {stop.pose.x:.1f} m, y {stop.pose.y:.1f} m"
    return str(number), _seconds(stop.time_s), _seconds(stop.duration_s), where, stop.why


def _table(title: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Nothing without rows."""
    lines = ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows]
    if not lines:
        return []
    heads = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return [f"<h2>{escape(title)}</h2><table><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>"]


def _seconds(time_s: float) -> str:
    return f"{time_s:.1f} s" if time_s < 60.0 else f"{int(time_s // 60.0)} min {time_s % 60.0:.0f} s"


def _millimetres(error_m: float, error_deg: float | None = None) -> str:
    """Unknown where nothing was measured."""
    if not math.isfinite(error_m):
        return "unknown"
    return f"{1e3 * error_m:.0f} mm" + ("" if error_deg is None else f", {error_deg:.1f}°")

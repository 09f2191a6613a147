"""The page of `robot-stack report`."""

from __future__ import annotations

import time
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from html import escape

from robot_stack.cli.html_page import figures, millimetres, page, seconds, state_line, table
from robot_stack.contract.states import ENDED, MissionState
from robot_stack.core.kept_events import EventRecord
from robot_stack.core.rides import RideComfort, RideRecord, RideStop

# An event this long after a ride's end still belongs to it: a stop that ended the mission.
_AFTER_S = 10.0


def report_page(
    title: str,
    rides: Sequence[RideRecord],
    events: Sequence[EventRecord],
    pictures: Mapping[str, bytes],
    event_pictures: Mapping[str, bytes] | None = None,
    battery: bytes | None = None,
) -> str:
    """One HTML file that needs nothing else. pictures, event_pictures: PNGs by id. battery: a PNG of its charge."""
    shown = event_pictures or {}
    parts = [
        f"<h1>{escape(title)}</h1>",
        figures(_totals(rides, events)),
        *table("Rides", ("begin", "mission", "ended as", "driven", "took", "stops"), map(_ride_row, rides)),
        *([] if battery is None else ["<h3>Battery</h3>", _picture(battery, "The battery's charge over the day")]),
        *table("Kept events", ("at", "reasons", "folder"), map(_event_row, events)),
        *(item for event in events if event.id in shown for item in _event(event, shown[event.id])),
    ]
    for ride in rides:
        parts += _ride(ride, [event for event in events if _belongs(event, ride)], pictures[ride.id])
    return page(title, parts)


def _totals(rides: Sequence[RideRecord], events: Sequence[EventRecord]) -> Iterable[tuple[str, str]]:
    done = sum(ride.state == MissionState.COMPLETED for ride in rides)
    carrying = [ride for ride in rides if ride.carried_m > 0.0]
    stops = sum(len(ride.stops) for ride in rides)
    distance_m = sum(ride.distance_m for ride in rides)
    charges = [value for ride in rides for value in ride.battery if value is not None]
    yield f"{done} of {len(rides)}", "rides completed"
    yield f"{distance_m:.0f} m", "driven"
    yield f"{len(carrying)} ({sum(ride.carried_m for ride in carrying):.0f} m)", "rides with a wheelchair"
    yield seconds(sum(ride.duration_s for ride in rides)), "under way"
    yield f"{stops} ({seconds(sum(ride.stood_s for ride in rides))})", "stops"
    yield f"{max(ride.top_speed_mps for ride in rides):.2f} m/s", "top speed"
    yield f"{min(charges):.0%}" if charges else "unknown", "lowest charge"
    yield str(len(events)), "kept events"


def _ride(ride: RideRecord, events: Sequence[EventRecord], picture: bytes) -> list[str]:
    known = any(value is not None for value in ride.battery)
    charge = " to ".join("unknown" if value is None else f"{value:.0%}" for value in ride.battery)
    numbers = (
        (f"{ride.distance_m:.1f} m", "driven"),
        (f"{ride.carried_m:.1f} m", "with a wheelchair"),
        (seconds(ride.duration_s), "from start to end"),
        (f"{ride.top_speed_mps:.2f} m/s", "top speed"),
        (f"{len(ride.stops)} ({seconds(ride.stood_s)})", "stops"),
        (charge if known else "unknown", "battery"),
        *_comfort(ride.comfort),
    )
    dockings = (
        (seconds(item.at_s), "unknown" if item.error_m is None else millimetres(item.error_m, item.error_deg))
        for item in ride.dockings
    )
    return [
        f'<h2 id="{escape(ride.id)}">{_clock(ride.began_s)} {escape(ride.mission_name or ride.mission_id)}</h2>',
        state_line(_ended_as(ride), ride.reason),
        figures(numbers),
        _picture(picture, "The route on the map with its numbered stops, and the speed over time"),
        *table("Stops", ("", "from", "for", "where", "why"), map(_stop_row, range(1, 10**6), ride.stops)),
        *table("Waypoints", ("", "done after"), ((item.name, seconds(item.done_s)) for item in ride.waypoints)),
        *table("Dockings", ("after", "off the dock pose, as measured by the robot"), dockings),
        *table("Kept events", ("at", "reasons", "folder"), map(_event_row, events)),
    ]


def _comfort(comfort: RideComfort | None) -> Iterable[tuple[str, str]]:
    """See docs/recording.md for what the numbers mean."""
    if comfort is not None:
        yield f"{comfort.total_mps2:.2f} m/s²", "vibration at the seat (ISO 2631-1)"
        yield f"{comfort.jerk_p99_mps3:.1f} m/s³", "jerk, 99th percentile"


def _event(event: EventRecord, picture: bytes) -> list[str]:
    text = f"{_clock(event.at_s)} {', '.join(event.reasons)}"
    return [f"<h4>{escape(text)}</h4>", _picture(picture, f"Around the robot at {text}")]


def _picture(png: bytes, text: str) -> str:
    return f'<img src="data:image/png;base64,{b64encode(png).decode()}" alt="{escape(text)}">'


def _belongs(event: EventRecord, ride: RideRecord) -> bool:
    return 0.0 <= event.at_s - ride.began_s <= ride.duration_s + _AFTER_S


def _ride_row(ride: RideRecord) -> tuple[str, ...]:
    link = f"#{ride.id} {_clock(ride.began_s)}"
    name, stops = ride.mission_name or ride.mission_id, str(len(ride.stops))
    return link, name, _ended_as(ride), f"{ride.distance_m:.0f} m", seconds(ride.duration_s), stops


def _ended_as(ride: RideRecord) -> str:
    """A ride of which the end is not recorded: it goes on, the recording ends before it, or the power failed."""
    return ride.state if ride.state in ENDED else f"{ride.state}, end not recorded"


def _event_row(event: EventRecord) -> tuple[str, ...]:
    return _clock(event.at_s), ", ".join(event.reasons), event.id


def _stop_row(number: int, stop: RideStop) -> tuple[str, ...]:
    where = "unknown" if stop.x is None or stop.y is None else f"x {stop.x:.1f} m, y {stop.y:.1f} m"
    return str(number), seconds(stop.begin_s), seconds(stop.duration_s), where, stop.why


def _clock(at_s: float) -> str:
    return time.strftime("%H:%M:%S", time.localtime(at_s))

"""report: the rides of a day, or of a recording, on one page."""

from __future__ import annotations

import json
import math
import time
from datetime import MAXYEAR, date, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.text import Text

from robot_stack.cli.errors import WRONG_USE, CommandError, writing
from robot_stack.cli.tables import console, table

if TYPE_CHECKING:
    from robot_stack.core.kept_events import EventRecord
    from robot_stack.core.rides import RideRecord

_STEP_S = 0.2
# Files of one recording follow each other: beyond these, the next file belongs to another one, and so does its ride.
_OVERLAP_S, _PAUSE_S = 1.0, 60.0
_FIRST_YEAR = 1970
_COLUMNS: list[tuple[str, Literal["left", "right"]]] = [
    ("begin", "left"),
    ("mission", "left"),
    ("state", "left"),
    ("m", "right"),
    ("with chair, m", "right"),
    ("min", "right"),
    ("stops", "right"),
    ("battery", "right"),
]


def report(
    what: Annotated[
        str, typer.Argument(metavar="DAY|RECORDING", help="today, yesterday, a date YYYY-MM-DD, or a recording.")
    ] = "today",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File to write; by default report-DAY.html in this folder.")
    ] = None,
    map_name: Annotated[
        str | None, typer.Option("--map", help="Map of the site; by default localization's, '' for none.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the records as JSON; no page.")] = False,
) -> None:
    """Sum up the rides of a day: routes on the map, stops with their reasons, docking, comfort, battery, kept events.

    The black box keeps a record of each mission. Exit code 1 if there was no ride.
    """
    path = Path(what)
    day = _day(what) if not path.exists() else None
    if day is None and not path.exists():
        raise CommandError(f"{what!r} is no day (today, yesterday, YYYY-MM-DD) and no recording", WRONG_USE)
    rides, events = _of_day(day) if day else (_of_recording(path), _of_event(path))
    title = f"{day:%A}, {day}" if day else path.resolve().name
    if as_json:
        print(json.dumps([ride.model_dump(mode="json") for ride in rides], indent=2))
    elif rides:
        _print(title, rides)
        file = output or Path(f"report-{day or path.resolve().stem}.html")
        _write_page(file, title, rides, events, map_name, {} if day else {event.id: path for event in events})
        print(f"{file} ({file.stat().st_size / 1e6:.1f} MB)")
    if not rides:
        raise CommandError(f"no rides on {day}" if day else f"{path} contains no mission")


def _day(what: str) -> date | None:
    today = datetime.now().astimezone().date()
    named = {"today": today, "yesterday": today - timedelta(days=1)}
    if what in named:
        return named[what]
    try:
        day = date.fromisoformat(what)
    except ValueError:
        return None
    return day if _FIRST_YEAR <= day.year < MAXYEAR else None


def _of_day(day: date) -> tuple[list[RideRecord], list[EventRecord]]:
    from robot_stack.core.kept_events import events_dir, read_events
    from robot_stack.core.rides import read_rides, rides_dir

    midnight = datetime.combine(day, datetime.min.time())
    from_s, until_s = (item.astimezone().timestamp() for item in (midnight, midnight + timedelta(days=1)))
    rides, damaged = read_rides(rides_dir(), from_s, until_s)
    for path in damaged:
        typer.echo(f"{path} is no record of a ride and is left out", err=True)
    events = [event for event in read_events(events_dir()) if from_s <= event.at_s < until_s]
    return rides, sorted(events, key=lambda event: event.at_s)


def _of_event(path: Path) -> list[EventRecord]:
    """The event in a folder, if it is that of one."""
    from robot_stack.core.kept_events import read_record

    record = read_record(path) if path.is_dir() else None
    return [] if record is None else [record]


def _of_recording(path: Path) -> list[RideRecord]:
    from robot_stack.cli.recordings import read_messages, recording_files
    from robot_stack.contract import topics
    from robot_stack.core.comfort import load_seat
    from robot_stack.recording.ride_messages import RideMessages, add_motion
    from robot_stack.recording.rides import RideWatch

    messages, watch = RideMessages(), RideWatch(load_seat())
    found: list[tuple[int, RideRecord | None]] = []  # by the number of the recording
    last_s, number = -math.inf, 0
    for file in recording_files(path):
        begins = True
        for item in read_messages(file, (*messages.names, topics.IMU.name), lambda _: None):
            if isinstance(item, str):
                typer.echo(item, err=True)
                continue
            if begins and not -_OVERLAP_S <= item.at_s - last_s <= _PAUSE_S:
                found.append((number, watch.end()))
                messages, number = RideMessages(), number + 1
            begins = False
            if abs(item.at_s - last_s) >= _STEP_S:  # also after the clock was set back
                last_s = item.at_s
                found.append((number, watch.step(messages.observation(item.at_s, item.at_s))))
            if item.topic == topics.IMU.name:
                add_motion(watch, item.decode())
            else:
                messages.take(item.topic, item.decode(), item.at_s)
    found.append((number, watch.end()))
    rides = {(number, record.id): record for number, record in found if record}
    # In a simulation, rides of two recordings may begin at the same time.
    return [
        record if number == 1 else record.model_copy(update={"id": f"{name}-{number}"})
        for (number, name), record in rides.items()
    ]


def _print(title: str, rides: list[RideRecord]) -> None:
    shown = table(title, _COLUMNS)
    for ride in rides:
        cells = (
            time.strftime("%H:%M:%S", time.localtime(ride.began_s)),
            ride.mission_name or ride.mission_id,
            ride.state,
            f"{ride.distance_m:.0f}",
            f"{ride.carried_m:.0f}",
            f"{ride.duration_s / 60.0:.1f}",
            str(len(ride.stops)),
            " to ".join("?" if value is None else f"{value:.0%}" for value in ride.battery),
        )
        shown.add_row(*map(Text, cells))
    console().print(shown)


def _write_page(
    file: Path,
    title: str,
    rides: list[RideRecord],
    events: list[EventRecord],
    map_name: str | None,
    folders: dict[str, Path],
) -> None:
    """folders: of events by id, where they are not those of the black box."""
    from robot_stack.cli.event_picture import event_picture
    from robot_stack.cli.report_page import report_page
    from robot_stack.cli.report_pictures import battery_picture, ride_picture
    from robot_stack.core.kept_events import events_dir
    from robot_stack.core.site_map import chosen_map, load_map

    name = chosen_map(map_name)
    grid = load_map(name).grid if name else None
    pictures = {ride.id: ride_picture(ride, grid) for ride in rides}
    found = {event.id: event_picture(folders.get(event.id, events_dir() / event.id), event) for event in events}
    shown = {name: picture for name, picture in found.items() if picture is not None}
    text = report_page(title, rides, events, pictures, shown, battery_picture(rides, events))
    with writing(file):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")

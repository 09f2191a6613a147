"""events list, show, path, export, delete: what the black box has kept."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.text import Text

from robot_stack.cli.errors import WRONG_USE, CommandError, writing
from robot_stack.cli.tables import console, table

if TYPE_CHECKING:
    from robot_stack.core.kept_events import EventRecord

events = typer.Typer(help="Events that the black box has kept: list, show, path, export, delete.", no_args_is_help=True)

AsJson = Annotated[bool, typer.Option("--json", help="Print as JSON.")]
EventId = Annotated[str, typer.Argument(metavar="ID", help="As in `events list`; latest for the newest.")]


@events.command("list")
def list_events(as_json: AsJson = False) -> None:
    """The events on this computer, the newest first."""
    from robot_stack.core.kept_events import read_events

    found = read_events(_folder())
    if as_json:
        print(json.dumps([_summary(event) for event in found], indent=2))
        return
    if not found:
        print(f"no events in {_folder()}")
        return
    shown = table(
        "events", [("id", "left"), ("began", "left"), ("state", "left"), ("MB", "right"), ("reasons", "left")]
    )
    for event in found:
        item = _summary(event)
        cells = (event.id, item["began"], event.state.value, f"{item['megabytes']:.1f}", ", ".join(event.reasons))
        shown.add_row(*map(Text, cells))
    console().print(shown)


@events.command()
def show(event_id: EventId, as_json: AsJson = False) -> None:
    """An event: its triggers, software, map, and the nodes at its first trigger."""
    event = _find(event_id)
    if as_json:
        print(json.dumps({**_summary(event), **event.model_dump(mode="json")}, indent=2))
        return
    print(f"{event.id}, {event.state.value}: {_folder() / event.id}")
    for trigger in event.triggers:
        print(f"{_local(trigger.at_s)}: {', '.join(trigger.reasons)} (ROS time {trigger.ros_s:.3f} s)")
    print(f"software: {event.software.version}, SHA-256 {event.software.sha256}")
    print(f"map: {event.map.name}, SHA-256 {event.map.sha256}" if event.map else "map: none")
    for node in event.nodes:
        state = "ready" if node.ready else f"not ready: {node.text}"
        print(f"{node.name}: process {node.pid}, silent for {node.silent_s:.1f} s, {state}")


@events.command()
def path(event_id: EventId) -> None:
    """The folder of an event, which rosbag2, Foxglove and `robot-stack film` read."""
    print(_folder() / _find(event_id).id)


@events.command()
def export(
    event_id: EventId, target: Annotated[Path, typer.Argument(help="A folder, e.g. of a memory stick.")]
) -> None:
    """Copy an event into a folder. Exit code 1 if it is still being recorded."""
    event = _find_ended(event_id)
    copy = target / event.id
    if copy.exists():
        raise CommandError(f"{copy} exists already", WRONG_USE)
    with writing(copy):
        shutil.copytree(_folder() / event.id, copy)
    print(copy)


@events.command()
def delete(
    event_id: EventId, yes: Annotated[bool, typer.Option("--yes", help="Do not ask for a confirmation.")] = False
) -> None:
    """Delete an event. Exit code 1 if it is still being recorded."""
    from robot_stack.core.kept_events import delete_event

    event = _find_ended(event_id)
    if not yes:
        typer.confirm(f"delete {event.id} ({', '.join(event.reasons)})?", abort=True)
    with writing(_folder() / event.id):
        delete_event(_folder() / event.id)
    print(f"deleted {event.id}")


def _folder() -> Path:
    from robot_stack.core.kept_events import events_dir

    return events_dir()


def _find(event_id: str) -> EventRecord:
    from robot_stack.core.kept_events import read_events

    found = read_events(_folder())
    if not found:
        raise CommandError(f"no events in {_folder()}", WRONG_USE)
    for event in found:
        if event_id in (event.id, "latest"):
            return event
    raise CommandError(
        f"there is no event {event_id!r} in {_folder()}; `robot-stack events list` shows them", WRONG_USE
    )


def _find_ended(event_id: str) -> EventRecord:
    from robot_stack.core.kept_events import EventState

    event = _find(event_id)
    if event.state is EventState.OPEN:
        raise CommandError(f"{event.id} is still being recorded: try again in some seconds")
    return event


def _summary(event: EventRecord) -> dict[str, Any]:
    from robot_stack.core.kept_events import event_bytes

    folder = _folder() / event.id
    return {
        "id": event.id,
        "began": _local(event.at_s),
        "state": event.state.value,
        "reasons": list(event.reasons),
        "megabytes": round(1e-6 * event_bytes(folder), 1),
        "path": str(folder),
    }


def _local(at_s: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(at_s))

"""mission list, start, pause, resume, abort, watch; the queue of orders is in mission_queue."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Annotated

import typer

from robot_stack.cli.errors import CommandError
from robot_stack.cli.mission_queue import change, queue
from robot_stack.cli.safety import Timeout

if TYPE_CHECKING:
    from robot_stack.cli.nodes.operator_commands import Mission

mission = typer.Typer(help="Missions: list, start, change, pause, resume, abort, watch, queue.", no_args_is_help=True)
mission.add_typer(queue, name="queue")
mission.command()(change)


@mission.command("list")
def list_missions() -> None:
    """The missions of config/missions/ and those made on this robot. Exit code 1 if a file is wrong."""
    from robot_stack.core.mission_library import MissionError, mission_library

    library = mission_library()
    wrong = False
    for mission_id in library.ids():
        try:
            found = library.find(mission_id)
        except MissionError as error:
            wrong = True
            print(f"{mission_id}: {error}")
            continue
        print(f"{mission_id}: {found.name_in('en')}, {len(found.waypoints)} waypoints")
    if wrong:
        raise typer.Exit(1)


@mission.command()
def start(
    mission_id: Annotated[str, typer.Argument(help="Id, as in `mission list`.")], timeout_s: Timeout = 5.0
) -> None:
    """Start a mission; during another one, put it into the queue."""
    _command("START_MISSION", mission_id, timeout_s)


@mission.command()
def pause(timeout_s: Timeout = 5.0) -> None:
    """Hold the position until resumed."""
    _command("PAUSE", "", timeout_s)


@mission.command()
def resume(timeout_s: Timeout = 5.0) -> None:
    """Go on with a paused mission."""
    _command("RESUME", "", timeout_s)


@mission.command()
def abort(timeout_s: Timeout = 5.0) -> None:
    """End the mission where the robot stands; a passenger stays attached."""
    _command("ABORT", "", timeout_s)


@mission.command()
def watch(
    once: Annotated[bool, typer.Option("--once", help="Print the status now and return.")] = False,
    timeout_s: Timeout = 5.0,
) -> None:
    """Follow the mission's status until Ctrl-C."""
    from robot_stack.cli.nodes.operator_commands import watch_mission

    shown: list[str] = []

    def report(status: Mission) -> None:
        line = describe(status)
        if [line] != shown:
            shown[:] = [line]
            print(line, flush=True)

    with contextlib.suppress(KeyboardInterrupt):
        watch_mission(report, timeout_s, follow=not once)


def describe(status: Mission) -> str:
    """The status in one line for users."""
    parts = [status.state]
    if status.mission_id:
        parts.append(f"{status.mission_id} {status.completed}/{status.total} waypoints, {status.progress:.0%}")
    if status.waypoint:
        parts.append(f"to {status.waypoint}")
    if status.eta_s is not None and status.mission_id:
        parts.append(f"{status.eta_s:.0f} s left")
    if status.passenger:
        parts.append("passenger aboard")
    if status.reason:
        parts.append(status.reason)
    return ", ".join(parts)


def _command(command: str, mission_id: str, timeout_s: float) -> None:
    from robot_stack.cli.nodes.operator_commands import command_mission

    status = command_mission(command, mission_id, timeout_s)
    if not status.accepted:
        raise CommandError(f"{command} was refused: {status.reason}")
    print(describe(status))

"""up, down, status, restart, run: the processes of the stack."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from robot_stack.cli.errors import WRONG_USE, CommandError
from robot_stack.cli.safety_state import safety_lines, settled_safety
from robot_stack.core.runtime import touch_screen_url
from robot_stack.supervisor.control import NotRunning, ask

_MONITOR = "safety_monitor"
_SAFETY_S = 5.0  # the status comes at 10 Hz, but a new subscription takes a moment, and a fault 2 s to clear
_SLOWEST = 0.05

Profile = Annotated[
    str,
    typer.Option("--profile", "-p", help="sim, robot, manipulator, general, diff_drive, or the path of a file."),
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", "-s", metavar="NODE.PARAMETER=VALUE", help="Override a parameter; may be repeated."),
]


def up(
    profile: Profile = "sim",
    settings: Settings = None,
    only: Annotated[list[str] | None, typer.Option("--only", help="Run just this process; may be repeated.")] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(help="Leave out a process that other software replaces; may be repeated."),
    ] = None,
    fleet: Annotated[
        str | None,
        typer.Option(metavar="URL", help="Take orders of a fleet from this broker: mqtts://HOST:PORT, see `fleet`."),
    ] = None,
    speed: Annotated[
        float | None, typer.Option(help="Maximum speed of the simulated world relative to real time.")
    ] = None,
    system_time: Annotated[
        bool,
        typer.Option("--system-time", help="The simulated world waits for no node; nodes use the system clock."),
    ] = False,
    foreground: Annotated[
        bool, typer.Option("--foreground", "-f", help="Run in the foreground, for systemd; Ctrl-C stops the stack.")
    ] = False,
    log_dir: Annotated[
        Path | None, typer.Option(help="Folder of the logs, by default ~/.local/state/robot_stack/logs.")
    ] = None,
    deadline_s: Annotated[
        float | None, typer.Option("--deadline", help="Seconds to wait for every process; default from the profile.")
    ] = None,
) -> None:
    """Start the stack and return when every process is ready."""
    from robot_stack.supervisor import client, progress
    from robot_stack.supervisor.profile import load_plan

    launch = client.Launch(
        profile,
        settings or (),
        only or (),
        speed,
        log_dir,
        system_time,
        without=tuple(without or ()),
        fleet=fleet,
    )
    # Validated here too, to report an error at once.
    plan = load_plan(
        profile,
        settings=launch.settings,
        only=launch.only,
        without=launch.without,
        speed=speed,
        system_time=system_time,
        fleet=fleet,
    )
    try:
        if foreground:
            client.refuse_second()
            command = launch.command("--foreground")
            os.execve(command[0], command, launch.environment())
        with progress.shown() as show:
            status = client.start(launch, deadline_s or plan.ready_deadline_s, show)
    except client.StartError as error:
        raise CommandError(str(error)) from None
    print(f"{len(status['processes'])} processes are ready after {status['ready_after_s']:.1f} s; profile {plan.name}")
    if status["missing"]:
        print(f"missing, not built yet: {', '.join(status['missing'])}")
    print(f"logs: {status['log_dir']}")
    if url := touch_screen_url():
        print(f"touch screen: {url}")
    if any(item["name"] == _MONITOR for item in status["processes"]):
        pace = min(1.0, status["sim_pace"] or 1.0)  # faults clear in the world's time
        print("\n".join(safety_lines(settled_safety(_SAFETY_S / max(pace, _SLOWEST)))))
        with contextlib.suppress(NotRunning, TimeoutError):
            status = ask("status")
    if progress.pace_text(status):
        print(f"{progress.pace_text(status)}: this machine is too slow for real time; the world waits for the nodes")


def down() -> None:
    """Stop the stack of this ROS domain in any state, with all its processes."""
    from robot_stack.supervisor import client

    try:
        answer = client.stop()
    except NotRunning as error:
        print(error)
        return
    killed = f"; had to be killed: {', '.join(answer['killed'])}" if answer["killed"] else ""
    print(f"stopped {len(answer['stopped']) or len(answer['killed'])} processes{killed}")


def restart(process: Annotated[str, typer.Argument(help="Name of the process.")]) -> None:
    """Stop one process and start it again; also one that was given up."""
    answer = _ask("restart", process=process)
    if not answer["ok"]:
        raise CommandError(answer["error"], WRONG_USE)
    print(f"{process} restarts")


def status(
    once: Annotated[bool, typer.Option("--once", help="Print once instead of following.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print once, as JSON.")] = False,
) -> None:
    """Show every process: state, restarts, heartbeat, CPU and memory. Exit code 1 if one is not ready."""
    from robot_stack.cli.status import StatusView

    view = StatusView()
    if as_json or once or not sys.stdout.isatty():
        view.measure(_ask("status"))
        time.sleep(0.5)  # period of the CPU measurement
        now = view.measure(_ask("status"))
        print(json.dumps(now, indent=2)) if as_json else view.print(now)
        raise typer.Exit(0 if now["ready"] else 1)
    view.follow(lambda: _ask("status"))


def run(
    context: typer.Context,
    node: Annotated[str, typer.Argument(help="Name of the process, as in docs/interfaces.md.")],
) -> None:
    """Run one process of the stack in this terminal. Arguments after its name go to it, e.g. --ros-args -p a:=1."""
    from robot_stack.core.wheels_env import ros_environment

    command = [sys.executable, "-m", "robot_stack.ros.main", node, *context.args]
    os.execve(command[0], command, {**os.environ, **ros_environment()})


def _ask(verb: str, **arguments: Any) -> dict[str, Any]:
    try:
        return ask(verb, **arguments)
    except NotRunning:
        raise CommandError(f"no stack is running in ROS domain {os.environ.get('ROS_DOMAIN_ID', '0')}") from None
    except TimeoutError:
        raise CommandError("the supervisor does not answer; `robot-stack down` ends it") from None

"""record and scenario: verbs that are programs of their own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from robot_stack.cli.errors import CommandError
from robot_stack.supervisor.control import NotRunning, ask

# By name: the stack does not import the simulation.
_SCENARIO_RUNNER = "sim.run.runner"


def record(
    output: Annotated[
        Path | None, typer.Option("--output", help="Folder of recordings; by default the recorder's.")
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the recording; by default the time in UTC.")] = None,
    include: Annotated[list[str] | None, typer.Option(help="Record only topics that fit, e.g. '/safety/*'.")] = None,
    exclude: Annotated[list[str] | None, typer.Option(help="Leave out topics that fit, e.g. '/sensors/*'.")] = None,
) -> None:
    """Record every contract topic into MCAP until Ctrl-C; rosbag2 and Foxglove read it."""
    from robot_stack.core.wheels_env import ros_environment

    parameters: dict[str, Any] = {**_running()}
    parameters |= {"output_folder": str(output.absolute())} if output else {}
    parameters |= {"name": name} if name else {}
    parameters |= {"include": include} if include else {}
    parameters |= {"exclude": exclude} if exclude else {}
    # JSON is YAML, which is what ROS reads parameter values as.
    arguments = [part for key, value in parameters.items() for part in ("-p", f"{key}:={json.dumps(value)}")]
    command = [
        sys.executable,
        "-m",
        "robot_stack.ros.main",
        "recorder",
        *(["--ros-args", *arguments] if arguments else []),
    ]
    os.execve(command[0], command, {**os.environ, **ros_environment()})


def _running() -> dict[str, Any]:
    """What the recorder must know of the stack that runs."""
    try:
        status = ask("status")
    except (NotRunning, TimeoutError):
        return {}
    systems = {"systems": [status["machine"], "simulation"]}
    return {**systems, "use_sim_time": True} if status["use_sim_time"] else systems


def scenario(
    context: typer.Context,
    file: Annotated[
        Path, typer.Argument(help="Scenario, a YAML file of config/scenarios/.", exists=True, dir_okay=False)
    ],
) -> None:
    """Run a scenario in the simulation and write figures, plots and the effective configuration into a folder."""
    from robot_stack.core.wheels_env import ros_environment

    environment = {**os.environ, **ros_environment()}
    command = [sys.executable, "-m", _SCENARIO_RUNNER, str(file), *context.args]
    try:
        code = subprocess.run(command, env=environment, check=False).returncode
    except KeyboardInterrupt:
        raise CommandError("interrupted", 130) from None
    raise typer.Exit(code)

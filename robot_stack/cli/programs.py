"""record, replay and simulate: verbs that start separate programs."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from robot_stack.supervisor.control import NotRunning, ask

# By name, because the stack does not import the simulation.
_SIMULATION, _REPLAY = "sim.stack.simulate", "sim.replay.main"


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
    # ROS parses parameter values as YAML, which includes JSON.
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
    """The recorder's settings for the running stack."""
    try:
        status = ask("status")
    except (NotRunning, TimeoutError):
        return {}
    systems = {"systems": [status["machine"], "simulation"]}
    return {**systems, "use_sim_time": True} if status["use_sim_time"] else systems


def simulate(context: typer.Context) -> None:
    """Run a scenario, or go on from a recording: the whole stack and its world in one process, in virtual time."""
    from robot_stack.core.wheels_env import ros_environment

    # exec: Ctrl-C reaches only the simulation.
    command = [sys.executable, "-m", _SIMULATION, *context.args]
    os.execve(command[0], command, {**os.environ, **ros_environment()})


def replay(
    file: Annotated[Path, typer.Argument(help="An MCAP file, or the folder of a recording or of an event.")],
    node: Annotated[list[str] | None, typer.Option(help="This node alone; may be repeated.")] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", "-s", metavar="NODE.PARAMETER=VALUE", help="Override a parameter; may be repeated."),
    ] = None,
    present_config: Annotated[
        bool, typer.Option("--present-config", help="The present configuration instead of the stored one.")
    ] = False,
    until: Annotated[float | None, typer.Option(metavar="S", help="Only the first S seconds.")] = None,
    thin: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write what the nodes need into this new MCAP file.")
    ] = None,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the results.")] = None,
) -> None:
    """Run nodes of a recording alone with their recorded inputs, and compare their outputs with the recorded ones.

    In virtual time, by the tolerances of config/replay.yaml, with the configuration and the parameters stored with the
    recording, else the present ones. Nodes that need more than recorded topics are named with the reason.

    Exit codes: 0 the outputs of all compared nodes are reproduced; 1 there is a difference, or a node failed; 2 wrong
    use or configuration, no recording, or no node could be compared; 130 interrupted.
    """
    from robot_stack.core.wheels_env import ros_environment

    repeated = [("--node", name) for name in node or ()] + [("--set", text) for text in settings or ()]
    arguments = [part for pair in repeated for part in pair]
    arguments += ["--present-config"] if present_config else []
    arguments += ["--until", str(until)] if until is not None else []
    arguments += ["--thin", str(thin)] if thin is not None else []
    arguments += ["--json", str(json_file)] if json_file is not None else []
    command = [sys.executable, "-m", _REPLAY, *arguments, "--", str(file)]
    os.execve(command[0], command, {**os.environ, **ros_environment()})

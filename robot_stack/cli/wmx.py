"""wmx: the motion engine's parameters, and the home of the steering."""

from __future__ import annotations

import time
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from robot_stack.cli.errors import WRONG_USE, CommandError, writing

wmx = typer.Typer(help="Exports the motion engine's parameters, homes the steering.", no_args_is_help=True)


class Engine(Enum):
    SIMULATED = "simulated"
    VENDOR = "vendor"


@wmx.command()
def export(
    file: Annotated[Path, typer.Argument(help="The XML file to write.")],
    engine_config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A simulated engine's file whose parameters to write. Default: the robot's."),
    ] = None,
) -> None:
    """Write the vendor's parameter file, by default of the eight axes in config/robot.yaml."""
    from robot_stack.core.robot import load_robot
    from robot_stack.wmx.config import read_engine_config
    from robot_stack.wmx.parameter_blocks import file_values
    from robot_stack.wmx.robot_parameters import robot_parameters
    from robot_stack.wmx.simulated.parameter_file import write_file

    parameters = (
        robot_parameters(load_robot()) if engine_config is None else read_engine_config(engine_config).parameters
    )
    with writing(file):
        write_file(str(file), file_values(parameters))


@wmx.command()
def home(
    joints: Annotated[list[str] | None, typer.Argument(help="Steering joints, e.g. fl_steer. Default: all.")] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask.")] = False,
    engine: Annotated[Engine | None, typer.Option(help="Default: that of config/wmx_client.yaml.")] = None,
    timeout_s: Annotated[float, typer.Option("--timeout", min=0.1, metavar="SECONDS")] = 60.0,
) -> None:
    """Home the steering, while the profile runs and the robot stands.

    With homing.type current_position (config/robot.yaml) the present headings become straight ahead: align the wheels
    first. Prints zero_rad of absolute encoders, for config/robot.yaml. The robot then needs an emergency stop and its
    release.
    """
    from robot_stack.contract.frames import JOINTS, STEER_AXES
    from robot_stack.core.robot import load_robot
    from robot_stack.wmx import EngineError, connect
    from robot_stack.wmx.config import load_client_config
    from robot_stack.wmx.home_steering import HomingError, home_axes

    robot, client = load_robot(), load_client_config(None if engine is None else engine.value)
    steering = [JOINTS[joint] for joint in STEER_AXES]
    chosen = joints or steering
    unknown = set(chosen) - set(steering)
    if unknown:
        raise CommandError(f"{', '.join(sorted(unknown))}: must be of {', '.join(steering)}", WRONG_USE)
    manual = robot.steer.homing.type == "current_position"
    question = "Do the wheels point straight ahead?" if manual else "Is the robot free to turn its wheels?"
    if not yes and not typer.confirm(f"{question} The home of {', '.join(chosen)} will be set."):
        raise CommandError("nothing was homed")
    axes = {robot.axes[name].number: name for name in chosen}
    machine = {axis.number: name for name, axis in robot.axes.items()}
    try:
        with connect("home", client) as device:
            offsets = home_axes(device, axes, machine, pause=time.sleep, timeout_s=timeout_s)
    except (EngineError, HomingError) as error:
        raise CommandError(str(error)) from None
    print(f"homed: {', '.join(chosen)}; press and release the emergency stop before the robot moves again")
    if robot.steer.absolute_encoder:
        print("for axes in config/robot.yaml, because the drive's next start imports it:")
        for name, offset_rad in offsets.items():
            print(f"  {name}: zero_rad: {offset_rad:.6f}")

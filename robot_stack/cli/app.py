"""The verbs of ``robot-stack``."""

from __future__ import annotations

import typer

from robot_stack.cli import bench, dock, doctor, door, programs, safety, stack, topics
from robot_stack.cli.arm import arm
from robot_stack.cli.calibrate import calibrate
from robot_stack.cli.coverage import coverage
from robot_stack.cli.docking import docking
from robot_stack.cli.events import events
from robot_stack.cli.film import film
from robot_stack.cli.fleet import fleet
from robot_stack.cli.map import maps
from robot_stack.cli.mission import mission
from robot_stack.cli.pin import pin
from robot_stack.cli.report import report
from robot_stack.cli.view import view
from robot_stack.cli.wmx import wmx

app = typer.Typer(
    name="robot-stack",
    help="Operates the robot's stack: start and stop it, watch it, send missions, stop the robot.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(stack.up)
app.command()(stack.down)
app.command()(stack.status)
app.command()(stack.restart)
app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True})(stack.run)
app.add_typer(mission, name="mission")
app.add_typer(docking, name="docking")
app.add_typer(events, name="events")
app.add_typer(arm, name="arm")
app.add_typer(calibrate, name="calibrate")
app.add_typer(maps, name="map")
app.add_typer(wmx, name="wmx")
app.add_typer(fleet, name="fleet")
app.command()(dock.dock)
app.command()(dock.undock)
app.command()(door.confirm_door)
app.command()(safety.estop)
app.command()(safety.reset)
app.command()(topics.topics)
app.command()(programs.record)
app.command()(programs.replay)
app.command()(view)
app.command()(film)
app.command()(report)
app.command()(pin)
app.command()(doctor.doctor)
app.command()(bench.bench)
app.command()(coverage)
app.command(  # the simulation parses its own options, and has their help
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}
)(programs.simulate)

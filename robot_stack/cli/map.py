"""map build, teach, plan, show, check: a site's map from a ride or a floor plan."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from robot_stack.cli.errors import NOT_DONE

maps = typer.Typer(
    help="Maps of sites: build one from a ride, recorded or as it is driven, or from a floor plan; show it, check it.",
    no_args_is_help=True,
)


@maps.command()
def build(
    recordings: Annotated[
        list[Path],
        typer.Argument(help="Recordings: each a folder or .mcap of the recorder, or a rosbag2; several make one map."),
    ],
    name: Annotated[str, typer.Option(help="Name of the map; its folder is config/maps/NAME.")],
    output: Annotated[Path | None, typer.Option(help="Folder to put the map's folder into.")] = None,
    origin: Annotated[
        tuple[float, float, float] | None,
        typer.Option(help="x m, y m, yaw rad of the robot in the map where the first ride begins; by default 0 0 0."),
    ] = None,
    plot: Annotated[bool, typer.Option(help="Draw map.png.")] = True,
) -> None:
    """Build a map from a recorded ride, or from several of one site.

    Rides may begin anywhere and be of different days, but each must pass
    where another one has been: it is placed by what its LiDAR saw there.
    """
    from robot_stack.cli.map_build import build_from_recordings

    build_from_recordings(recordings, name, output, origin, plot)


@maps.command()
def teach(
    name: Annotated[str, typer.Option(help="Name of the map, which must be new; its folder is config/maps/NAME.")],
    output: Annotated[Path | None, typer.Option(help="Folder to put the map's folder into.")] = None,
    origin: Annotated[
        tuple[float, float, float] | None,
        typer.Option(help="x m, y m, yaw rad of the robot in the map where the ride begins; by default 0 0 0."),
    ] = None,
    recording: Annotated[
        Path | None, typer.Option(help="New folder for the ride's recording; by default among the recorder's.")
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(help="PNG of the growing map, redrawn every 2 s; by default growing.png in the recording."),
    ] = None,
) -> None:
    """Teach a map: drive by hand while the map grows; Ctrl-C builds it.

    This only listens to the running stack and records: drive the robot with
    joystick, stick or touch pad. Stand still for 3 s first, pass within 12 m of
    everything, cross your own way, end where you began.

    Ctrl-C ends the ride and builds the map. A second one leaves the recording
    and says how to build the map of it later.

    Lost localization stops the robot, also by hand: docs/mapping.md says how to
    start the stack at a site that has no map yet.
    """
    from robot_stack.cli.map_teach import teach_map

    teach_map(name, output, origin, recording, picture)


@maps.command()
def plan(
    picture: Annotated[Path, typer.Argument(help="Picture with dark walls, or a YAML file of Nav2's map_server.")],
    name: Annotated[str, typer.Option(help="Name of the map; its folder is config/maps/NAME.")],
    resolution: Annotated[float | None, typer.Option(help="m of a pixel; by default of the YAML file.")] = None,
    origin: Annotated[
        tuple[float, float, float] | None,
        typer.Option(help="x m, y m, yaw rad of the picture's lower left corner in the map; by default 0 0 0."),
    ] = None,
    start: Annotated[
        tuple[float, float],
        typer.Option(help="x m, y m in the map: a place on the floor, from where the rest is reached."),
    ] = (0.0, 0.0),
    wall_height: Annotated[float, typer.Option(help="m, of all walls.")] = 2.5,
    output: Annotated[Path | None, typer.Option(help="Folder to put the map's folder into.")] = None,
) -> None:
    """Make a map from a floor plan: dark is wall, white is floor.

    The map contains only what the plan shows, and its error is that of the plan.
    """
    from robot_stack.cli.map_plan import PlanOptions, build_from_plan

    build_from_plan(picture, name, output, PlanOptions(resolution, origin, start, wall_height))


@maps.command()
def show(
    name: Annotated[str, typer.Argument(help="Name in config/maps, or a folder.")],
    picture: Annotated[Path | None, typer.Option(help="Draw the map into this PNG file.")] = None,
) -> None:
    """Show a map's content, origin, zones and route graph."""
    from robot_stack.cli.map_build import lines_of
    from robot_stack.core.route_graph import graph_files, load_graph
    from robot_stack.core.site_map import load_map
    from robot_stack.core.zones import load_zones, zone_files

    site, zones, graph = load_map(name), load_zones(name), load_graph(name)
    for line in lines_of(site):
        typer.echo(line)
    if zones:
        typer.echo(f"zones: {zone_files(name).in_force}")
    for zone in zones:
        limit = f", {zone.speed_mps:g} m/s" if math.isfinite(zone.speed_mps) else ""
        limit += "" if math.isnan(zone.heading_rad) else f", {math.degrees(zone.heading_rad):g} deg"
        area_m2 = float(zone.cells(site.grid).sum()) * site.grid.resolution_m**2
        typer.echo(f"zone {zone.name}: {zone.type.value}{limit}, {area_m2:.1f} m2 of the map")
    if graph is not None:
        where = graph_files(name).in_force
        typer.echo(f"route graph: {len(graph.points)} nodes, {len(graph.ends)} edges, {where}")
    if picture is not None:
        from robot_stack.cli.map_picture import draw_map

        draw_map(site, picture, zones=zones, graph=graph)
        typer.echo(f"picture: {picture}")


@maps.command()
def check(name: Annotated[str, typer.Argument(help="Name in config/maps, or a folder.")]) -> None:
    """Check a map's files against their checksums, and whether it can be driven by. Exit code 1 if it cannot."""
    from robot_stack.cli.map_build import problems_of
    from robot_stack.core.site_map import load_map

    problems = problems_of(load_map(name))
    for problem in problems:
        typer.echo(problem)
    if problems:
        raise typer.Exit(NOT_DONE)
    typer.echo(f"{name}: complete, checksums agree")

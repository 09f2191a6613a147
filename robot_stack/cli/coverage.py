"""coverage: the field of view of the range sensors around the robot, as figures and as maps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robot_stack.cli.errors import WRONG_USE, CommandError, write_json, writing

if TYPE_CHECKING:
    from robot_stack.coverage.coverage import Body, Seen
    from robot_stack.coverage.params import CoverageParams


def coverage(
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the figures to this file.")] = None,
    pictures: Annotated[Path | None, typer.Option(help="Draw the maps into this folder.")] = None,
    layout: Annotated[
        str | None, typer.Option(help="A layout of config/coverage_layouts.yaml instead of the robot's sensors.")
    ] = None,
    compare: Annotated[bool, typer.Option("--compare", help="Compare all layouts.")] = False,
) -> None:
    """What the sensors of config/robot.yaml see around the robot, with and without wheelchair and passenger."""
    from robot_stack.core.docks import load_docks
    from robot_stack.core.robot import load_robot
    from robot_stack.core.robot_shape import load_robot_shape
    from robot_stack.coverage.params import load_coverage_params, load_layouts
    from robot_stack.coverage.report import bodies, figures, look_around, sensors_of

    robot, params = load_robot(), load_coverage_params()
    standing = bodies(robot, load_robot_shape(), load_docks())
    layouts = load_layouts().layouts
    if compare:
        chosen = {name: sensors_of(item, robot) for name, item in layouts.items()}
        found = {name: figures(look_around(item, standing, params), params) for name, item in chosen.items()}
        _print_comparison(found)
        _write(json_file, found)
        return
    if layout is not None and layout not in layouts:
        raise CommandError(f"no layout {layout!r}; there are {', '.join(layouts)}", WRONG_USE)
    sensors = sensors_of(layouts[layout], robot) if layout is not None else robot.range_sensors
    seen = look_around(sensors, standing, params)
    own = figures(seen, params)
    for name, value in own.items():
        print(f"{name:22s} {value:6.2f} %")
    _write(json_file, own)
    if pictures is not None:
        with writing(pictures):
            _draw(pictures, seen, standing, params)


def _write(file: Path | None, figures: object) -> None:
    if file is None:
        return
    write_json(file, figures)
    print(f"written to {file}")


def _print_comparison(found: dict[str, dict[str, float]]) -> None:
    from rich.console import Console
    from rich.table import Table

    names = [name for name in next(iter(found.values())) if name.startswith("seen_pct_")]
    table = Table("layout", *(name.removeprefix("seen_pct_") for name in names))
    for layout, values in found.items():
        table.add_row(layout, *(f"{values[name]:.1f}" for name in names))
    Console().print(table)


def _draw(folder: Path, seen: dict[str, Seen], standing: dict[str, Body], params: CoverageParams) -> None:
    from robot_stack.cli.coverage_picture import draw

    folder.mkdir(parents=True, exist_ok=True)
    for name, view in seen.items():
        for kind, what, maps in (("thing", "an object up to", view.things), ("map", "seen at", view.maps)):
            for height, points in maps.items():
                file = folder / f"{kind}_{round(10.0 * height):02d}_{name}.png"
                draw(view.grid, points, params.points_min, standing[name], f"{name}: {what} {height:g} m", file)
    print(f"drawn into {folder}")

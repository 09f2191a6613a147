"""``robot-stack map plan``: a map from the picture of a floor plan, or from a grid of Nav2's map_server."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from robot_stack.cli.errors import WRONG_USE, CommandError, writing
from robot_stack.cli.map_build import lines_of, place_of, size_of, wanted
from robot_stack.cli.map_picture import draw_map
from robot_stack.core.config import Config, load, read_yaml, validate
from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.core.levels import read_levels
from robot_stack.core.site_map import SiteMap, save_map
from robot_stack.mapping.floor_plan import Plan, PlanError, map_of_plan
from robot_stack.mapping.params import MappingParams

Triple = tuple[float, float, float]

_RESOLUTION_M = (0.005, 0.25)
_WALL_HEIGHT_M = (1.0, 20.0)
_MOST_PIXELS, _LONGEST_M = 16_000_000, 500.0
_DARK = 0.5  # of a picture without thresholds


class GridFile(Config):
    """The YAML file of Nav2's map_server."""

    image: str
    resolution: Annotated[float, Field(gt=0.0)]
    origin: Triple
    negate: bool = False
    occupied_thresh: Annotated[float, Field(gt=0.0, lt=1.0)]
    free_thresh: Annotated[float, Field(gt=0.0, lt=1.0)]
    mode: Literal["trinary", "scale"] = "trinary"


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """resolution_m, origin: of the picture; None: those of its YAML file. start: a place on the floor.

    Other levels are reached from the stops of lifts in ``levels.yaml`` beside the map.
    """

    resolution_m: float | None = None
    origin: Triple | None = None
    start: tuple[float, float] = (0.0, 0.0)
    wall_height_m: float = 2.5


def build_from_plan(source: Path, name: str, output: Path | None, options: PlanOptions, plot: bool = True) -> None:
    """Raises CommandError, ConfigError."""
    folder, origin = wanted(name, output, options.origin)
    low, high = _WALL_HEIGHT_M
    if not low <= options.wall_height_m <= high:
        raise CommandError(f"--wall-height must be {low:g} to {high:g} m, is {options.wall_height_m:g}", WRONG_USE)
    plan = read_plan(source, options.resolution_m, origin)
    start = Pose2(*options.start, 0.0)
    stops = [stop.pose for lift in read_levels(folder).lifts.values() for stop in lift.stops.values()]
    try:
        cells, grid = map_of_plan(plan, (start, *stops), options.wall_height_m, load(MappingParams, "mapping"))
    except PlanError as error:
        raise CommandError(f"{source}: {error}") from None
    about = {
        "frame": "map",
        "made_from": "a floor plan",
        "begins_at": place_of(start),
        "plan": {
            "picture": source.name,
            "resolution_m": plan.resolution_m,
            "origin": place_of(plan.origin),
            "wall_height_m": options.wall_height_m,
        },
        **size_of(cells, grid),
    }
    site = SiteMap(name, cells, grid, about)
    with writing(folder):
        save_map(site, folder)
    if plot:
        draw_map(site, folder / "map.png")
    print("\n".join(lines_of(site)))
    print(f"written: {folder}")


def read_plan(source: Path, resolution_m: float | None, origin: Pose2 | None) -> Plan:
    """A picture, or a YAML file of map_server; arguments replace the file's. Raises CommandError, ConfigError."""
    picture, free_below, occupied_above, negate = source, _DARK, _DARK, False
    if source.suffix in (".yaml", ".yml"):
        file = validate(GridFile, read_yaml(source), str(source))
        picture, negate = source.parent / file.image, file.negate
        free_below, occupied_above = file.free_thresh, file.occupied_thresh
        resolution_m = file.resolution if resolution_m is None else resolution_m
        origin = Pose2(*file.origin) if origin is None else origin
    if resolution_m is None:
        raise CommandError(f"{source}: the scale is missing: give --resolution, m of a pixel", WRONG_USE)
    low, high = _RESOLUTION_M
    if not low <= resolution_m <= high:
        raise CommandError(f"{source}: the resolution must be {low:g} to {high:g} m, is {resolution_m:g}", WRONG_USE)
    light = _brightness(picture, resolution_m)[::-1]
    dark = light if negate else 1.0 - light
    return Plan(dark > occupied_above, dark < free_below, resolution_m, origin or IDENTITY)


def _brightness(picture: Path, resolution_m: float) -> npt.NDArray[np.float64]:
    """(rows, columns) from 0, black, to 1, white; what is transparent is white. Raises CommandError."""
    from PIL import Image

    try:
        with Image.open(picture) as image:
            rows, columns = image.height, image.width
            longest_m = resolution_m * max(rows, columns)
            if rows * columns > _MOST_PIXELS or longest_m > _LONGEST_M:
                raise CommandError(
                    f"{picture}: {columns} x {rows} pixels of {resolution_m:g} m are too large: at most "
                    f"{_MOST_PIXELS:,} pixels and {_LONGEST_M:g} m; crop the picture, or correct the resolution"
                )
            if image.mode.startswith(("I", "F")):
                raise CommandError(f"{picture}: has pixels of more than 8 bits; save it with 8 bits")
            layers = image.convert("RGBA")
    except (OSError, Image.DecompressionBombError) as error:
        text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise CommandError(f"{picture}: no picture that can be read: {text}") from None
    white = Image.new("RGBA", layers.size, "white")
    return np.asarray(Image.alpha_composite(white, layers).convert("L"), np.float64) / 255.0

"""Zones of a site: where navigation may not drive, only slowly, only one way, or only through an open door.

They lie beside the site's map, ``config/maps/<name>/zones.geojson``. Zones edited on the robot are a file of its own
data, which is in force instead of the site's as long as it exists (``SiteFile``).

A GeoJSON FeatureCollection of Polygons, also with holes, in the map frame; coordinates x, y in m. Properties:
    name     for people, unique
    type     keepout: the footprint stays outside; speed: at most speed_limit_mps inside; one_way: base_link moves
             along heading_deg inside, counter-clockwise from x of map, and not against it; door: the footprint enters
             once the building reports the door of this name open
Zones are rules of the site, not obstacles: localization, the costmap and the safety monitor do not use them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from robot_stack.core.compiled import compiled
from robot_stack.core.config import Config, ConfigError, read_json
from robot_stack.core.mission import Coordinate, Name
from robot_stack.core.site_files import SiteFile, site_file
from robot_stack.core.site_map import Grid

ZONES_FILE = "zones.geojson"
# Slower than this is no useful limit: such a zone is one to keep out of, such a lane is none.
SLOWEST_MPS = 0.1


class ZoneType(StrEnum):
    KEEPOUT = "keepout"
    SPEED = "speed"
    ONE_WAY = "one_way"
    DOOR = "door"


class _Properties(Config):
    name: Name
    type: ZoneType
    speed_limit_mps: Annotated[float, Field(ge=SLOWEST_MPS, le=10.0)] | None = None
    heading_deg: Annotated[float, Field(ge=-360.0, le=360.0)] | None = None

    @model_validator(mode="after")
    def _limit_of_speed_zones(self) -> _Properties:
        if (self.type is ZoneType.SPEED) != (self.speed_limit_mps is not None):
            raise ValueError("speed_limit_mps belongs to zones of type speed, and each of them needs it")
        return self

    @model_validator(mode="after")
    def _heading_of_one_way_zones(self) -> _Properties:
        if (self.type is ZoneType.ONE_WAY) != (self.heading_deg is not None):
            raise ValueError("heading_deg belongs to zones of type one_way, and each of them needs it")
        return self


Position = Annotated[tuple[Coordinate, Coordinate], Field(strict=False)]


class _Polygon(Config):
    type: Literal["Polygon"]
    coordinates: Annotated[tuple[Annotated[tuple[Position, ...], Field(min_length=4)], ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _rings_are_closed(self) -> _Polygon:
        if any(ring[0] != ring[-1] for ring in self.coordinates):
            raise ValueError("each ring must end with its first position")
        return self


class _Feature(BaseModel):
    # Editors add ids and members of their own.
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)
    type: Literal["Feature"]
    properties: _Properties
    geometry: _Polygon


class _Collection(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)
    type: Literal["FeatureCollection"]
    features: tuple[_Feature, ...]

    @model_validator(mode="after")
    def _names_are_unique(self) -> _Collection:
        names = [feature.properties.name for feature in self.features]
        if len(set(names)) != len(names):
            raise ValueError("every zone needs a unique name")
        return self


@dataclass(frozen=True, slots=True)
class Zone:
    """rings: (n, 2) m, map, closed; the first is the outline, the others are holes.

    speed_mps: infinite without a limit. heading_rad: in map, of a one-way zone, else NaN.
    """

    name: str
    type: ZoneType
    rings: tuple[npt.NDArray[np.float64], ...]
    speed_mps: float
    heading_rad: float = math.nan

    def contains(self, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """Mask of the points inside; even-odd rule. x, y: same shape, m, map."""
        inside = np.zeros(np.size(x), np.bool_)
        flat_x, flat_y = np.array(x, np.float64).ravel(), np.array(y, np.float64).ravel()
        for ring in self.rings:
            _cross(ring, flat_x, flat_y, inside)
        return inside.reshape(np.shape(x))

    def overlaps(self, outline: npt.NDArray[np.float64]) -> bool:
        """Whether the zone and a convex polygon have a point in common. outline: (n, 2) corners in order, m, map."""
        if self.contains(outline[:, 0], outline[:, 1]).any():
            return True
        closed = np.vstack((outline, outline[:1]))
        return any(_meet(ring, closed) for ring in self.rings)

    def cells(self, grid: Grid) -> npt.NDArray[np.bool_]:
        """(rows, columns) cells of the grid whose middle is inside."""
        rows, columns = grid.occupancy.shape
        x = grid.origin_x_m + (np.arange(columns) + 0.5) * grid.resolution_m
        y = grid.origin_y_m + (np.arange(rows) + 0.5) * grid.resolution_m
        return self.contains(*np.meshgrid(x, y))

    def touched(self, grid: Grid) -> npt.NDArray[np.bool_]:
        """``cells``, and those that an outline passes: a zone may be narrower than a cell."""
        inside = self.cells(grid)
        rows, columns = inside.shape
        for a, b in (edge for ring in self.rings for edge in pairwise(ring)):
            count = math.ceil(2.0 * math.dist(a, b) / grid.resolution_m) + 1
            at = (np.linspace(a, b, count) - (grid.origin_x_m, grid.origin_y_m)) / grid.resolution_m
            column, row = np.floor(at).astype(np.int64).T
            on = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
            inside[row[on], column[on]] = True
        return inside


def _meet(ring: npt.NDArray[np.float64], outline: npt.NDArray[np.float64]) -> bool:
    """Whether a ring passes through a convex polygon or lies within it; both closed, (n, 2)."""
    inside = Zone("", ZoneType.KEEPOUT, (outline,), np.inf).contains(ring[:, 0], ring[:, 1])
    if inside.any():
        return True
    a, b = ring[:-1, None], ring[1:, None]
    c, d = outline[None, :-1], outline[None, 1:]
    apart = (_side(a, b, c) * _side(a, b, d) > 0.0) | (_side(c, d, a) * _side(c, d, b) > 0.0)
    parallel = _side(a, b, c) == _side(a, b, d)
    return bool((~apart & ~parallel).any())


def _side(
    a: npt.NDArray[np.float64], b: npt.NDArray[np.float64], p: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Positive for points p to the left of the line from a to b; all (..., 2), broadcast."""
    u, v = b - a, p - a
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


@compiled
def _cross(ring: Any, x: Any, y: Any, inside: Any) -> None:
    """Inverts ``inside`` at each of the (n,) points for every edge of the ring on its right."""
    for k in range(len(ring) - 1):
        ax, ay, bx, by = ring[k, 0], ring[k, 1], ring[k + 1, 0], ring[k + 1, 1]
        if ay == by:
            continue
        low, high, slope = min(ay, by), max(ay, by), (bx - ax) / (by - ay)
        for i in range(len(x)):
            if low <= y[i] < high and x[i] < ax + (y[i] - ay) * slope:
                inside[i] = not inside[i]


def zone_files(map_name: str) -> SiteFile:
    """Where the zones of a map lie. Raises ConfigError if there is no such map."""
    return site_file(map_name, ZONES_FILE)


def load_zones(map_name: str) -> tuple[Zone, ...]:
    """The zones of a map that are in force, none without a file. Raises ConfigError naming the zone and the key."""
    path = zone_files(map_name).existing
    return () if path is None else read_zones(path)


def read_zones(path: Path) -> tuple[Zone, ...]:
    """Raises ConfigError."""
    return zones_of(read_json(path), str(path))


def zones_of(content: Any, source: str) -> tuple[Zone, ...]:
    """The zones of a FeatureCollection. Raises ConfigError that begins with ``source``."""
    try:
        found = _Collection.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        raise ConfigError(f"{source}: {_place(content, first['loc'])}{first['msg']}") from None
    return tuple(
        Zone(
            name=feature.properties.name,
            type=feature.properties.type,
            rings=tuple(np.array(ring, np.float64) for ring in feature.geometry.coordinates),
            speed_mps=feature.properties.speed_limit_mps or np.inf,
            heading_rad=math.nan if (deg := feature.properties.heading_deg) is None else math.radians(deg),
        )
        for feature in found.features
    )


def _place(content: Any, loc: tuple[int | str, ...]) -> str:
    """Where the error is, with the zone's name if it has one: ``features.1 'lawn' properties.type: ``."""
    if len(loc) > 1 and loc[0] == "features" and isinstance(loc[1], int):
        properties = content["features"][loc[1]]
        name = properties.get("properties") if isinstance(properties, dict) else None
        shown = f" {name['name']!r}" if isinstance(name, dict) and isinstance(name.get("name"), str) else ""
        rest = ".".join(map(str, loc[2:]))
        return f"features.{loc[1]}{shown}{' ' if rest else ''}{rest}: "
    return ".".join(map(str, loc)) + (": " if loc else "")

"""Levels and lifts of a site beside its map, ``config/maps/<name>/levels.yaml``.

The levels of a building lie side by side in the plane of the map frame, so that a pose, a goal, a zone, a lane or a
dock has the level of its coordinates, and one map contains them all. A lift connects them: its cabin has a place in
each level that it serves. Without the file the site has one level.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from pathlib import Path
from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config, read_yaml, validate
from robot_stack.core.geometry import Pose2
from robot_stack.core.mission import Coordinate, Name, Yaw
from robot_stack.core.site_map import map_folder

LEVELS_FILE = "levels.yaml"


class Area(Config):
    """A rectangle of the map, m."""

    min_x_m: Coordinate
    max_x_m: Coordinate
    min_y_m: Coordinate
    max_y_m: Coordinate

    @model_validator(mode="after")
    def _has_a_size(self) -> Area:
        if self.max_x_m <= self.min_x_m or self.max_y_m <= self.min_y_m:
            raise ValueError("max_x_m and max_y_m must be above min_x_m and min_y_m")
        return self

    def has(self, x_m: float, y_m: float) -> bool:
        return self.min_x_m <= x_m < self.max_x_m and self.min_y_m <= y_m < self.max_y_m

    def overlaps(self, other: Area) -> bool:
        apart_x = self.max_x_m <= other.min_x_m or other.max_x_m <= self.min_x_m
        return not (apart_x or self.max_y_m <= other.min_y_m or other.max_y_m <= self.min_y_m)


class Stop(Config):
    """The cabin at a level. door: the zone of its door there. x_m, y_m, yaw_rad: of base_link in the cabin, map."""

    door: Name
    x_m: Coordinate
    y_m: Coordinate
    yaw_rad: Yaw

    @property
    def pose(self) -> Pose2:
        return Pose2(self.x_m, self.y_m, self.yaw_rad)


class Lift(Config):
    """radius_m: a robot so near to the pose of a stop, clear of the door's zone, is in the cabin. stops: by level."""

    radius_m: Annotated[float, Field(gt=0.0, le=2.0)]
    stops: Annotated[dict[Name, Stop], Field(min_length=2)]


class Levels(Config):
    """levels: by name. lifts: by name. The default is a site with one level."""

    levels: dict[Name, Area] = {}
    lifts: dict[Name, Lift] = {}

    @model_validator(mode="after")
    def _levels_are_apart(self) -> Levels:
        for (a, one), (b, other) in combinations(self.levels.items(), 2):
            if one.overlaps(other):
                raise ValueError(f"levels {a!r} and {b!r} overlap")
        return self

    @model_validator(mode="after")
    def _stops_are_on_their_levels(self) -> Levels:
        doors: set[str] = set()
        for name, lift in self.lifts.items():
            for level, stop in lift.stops.items():
                if level not in self.levels or not self.levels[level].has(stop.x_m, stop.y_m):
                    raise ValueError(f"lift {name!r}: its stop ({stop.x_m:g}, {stop.y_m:g}) is not on level {level!r}")
                if stop.door in doors:
                    raise ValueError(f"lift {name!r}: door {stop.door!r} belongs to another stop")
                doors.add(stop.door)
        return self

    def level_at(self, pose: Pose2) -> str | None:
        """Name of the level on which the pose lies; None beside all of them."""
        return next((name for name, area in self.levels.items() if area.has(pose.x, pose.y)), None)

    def area_at(self, pose: Pose2) -> Area | None:
        level = self.level_at(pose)
        return None if level is None else self.levels[level]

    @property
    def doors(self) -> Mapping[str, str]:
        """Name of the lift by the name of its door's zone."""
        return {stop.door: name for name, lift in self.lifts.items() for stop in lift.stops.values()}


def load_levels(map_name: str) -> Levels:
    """Of a map; without a file a site with one level. Raises ConfigError naming the key."""
    return read_levels(map_folder(map_name))


def read_levels(folder: Path) -> Levels:
    """Of a map's folder, which need not have a map yet. Raises ConfigError."""
    path = folder / LEVELS_FILE
    return validate(Levels, read_yaml(path), str(path)) if path.exists() else Levels()

"""World files: ``config/worlds/<name>.yaml``, the objects on the ground and its friction.

Frame: map, x east, y north, z up, ground at z = 0. Angles in the file are in degrees, because it is edited by hand.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config, ConfigError, Positive, config_dir, read_yaml, validate
from robot_stack.core.geometry import Pose2

Friction = Annotated[float, Field(gt=0.0, le=2.0)]


class Placed(Config):
    """An object with a place: (x_m, y_m) of its centre, turned by yaw_deg about z."""

    name: str
    x_m: float
    y_m: float
    yaw_deg: float = 0.0

    @property
    def yaw_rad(self) -> float:
        return math.radians(self.yaw_deg)


class Box(Placed):
    """An upright box on the ground: kerb, wall or obstacle. Length along its own x."""

    length_m: Positive
    width_m: Positive
    height_m: Positive


class Cylinder(Config):
    """An upright cylinder on the ground: pole, bollard, tree."""

    name: str
    x_m: float
    y_m: float
    radius_m: Positive
    height_m: Positive


class Ramp(Placed):
    """A way up, a flat top and the same way down. (x_m, y_m) is the middle of the foot, yaw_deg the way up."""

    slope_deg: Annotated[float, Field(gt=0.0, le=20.0)]
    height_m: Positive
    width_m: Positive
    top_length_m: Positive

    @property
    def slope_rad(self) -> float:
        return math.radians(self.slope_deg)

    @property
    def run_m(self) -> float:
        """Horizontal length of one slope."""
        return self.height_m / math.tan(self.slope_rad)

    @property
    def total_length_m(self) -> float:
        return 2.0 * self.run_m + self.top_length_m


class Patch(Placed):
    """A rectangle of ground with a friction of its own: wet paint, ice, gravel. Length along its own x."""

    length_m: Positive
    width_m: Positive
    friction: Friction


class Pit(Placed):
    """A rectangle of ground that lies deeper, with upright sides. Length along its own x.

    Sensors see it; the physics' ground stays level, and ``World.touching`` reports a wheel that rolls over the edge.
    """

    length_m: Positive
    width_m: Positive
    depth_m: Positive


class Person(Config):
    """A person who walks to and fro along a line, from its first point on, and rests at either end."""

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    points_m: Annotated[list[tuple[float, float]], Field(min_length=1)]
    speed_mps: Annotated[float, Field(gt=0.0, le=3.0)]
    pause_s: Annotated[float, Field(ge=0.0)] = 0.0

    @model_validator(mode="after")
    def _goes_on(self) -> Person:
        if any(a == b for a, b in itertools.pairwise(self.points_m)):
            raise ValueError("points_m: two points that follow each other are the same")
        return self


class Door(Placed):
    """An automatic sliding door: a panel like a box, closed at its place, which opens along its own x by its length.

    travel_s: the time of that. delay_s: from the first request of a session until it moves.
    """

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    length_m: Positive
    width_m: Positive
    height_m: Positive
    travel_s: Positive = 3.0
    delay_s: Annotated[float, Field(ge=0.0)] = 1.0


class LiftStop(Config):
    """The cabin at one level: x_m, y_m of its middle. door: the name of its door there, one of the world's."""

    door: str
    x_m: float
    y_m: float


class LiftCar(Config):
    """A lift whose levels lie side by side on the ground: its cabin is a place with walls at each of them.

    The robot is moved from one to the other with its wheelchair while the doors are closed. half_m: of the square
    around the middle in which base_link rides. travel_s: the time between two levels.
    """

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    half_m: Positive
    travel_s: Positive
    stops: Annotated[list[LiftStop], Field(min_length=2)]


class Floor(Config):
    """The part of the ground that the world shows, m."""

    min_x_m: float
    max_x_m: float
    min_y_m: float
    max_y_m: float

    @model_validator(mode="after")
    def _has_an_area(self) -> Floor:
        if self.max_x_m <= self.min_x_m or self.max_y_m <= self.min_y_m:
            raise ValueError("max_x_m and max_y_m must be above min_x_m and min_y_m")
        return self


class Place(Config):
    """A pose on the ground."""

    x_m: float
    y_m: float
    yaw_deg: float

    def pose(self) -> Pose2:
        return Pose2(self.x_m, self.y_m, math.radians(self.yaw_deg))


class Route(Config):
    """A way through the world that is kept free of obstacles half_width_m to either side."""

    half_width_m: Positive
    points_m: Annotated[list[tuple[float, float]], Field(min_length=2)]


class Charger(Config):
    """Contacts in front of a station's board, which meet the robot's within tolerance_m and tolerance_deg.

    base_x_m: base_link in the dock frame where they meet. power_w: with which they charge then.
    """

    base_x_m: Annotated[float, Field(lt=0.0)]
    tolerance_m: Positive
    tolerance_deg: Positive
    power_w: Positive


class WorldFile(Config):
    """Everything in one world file.

    wheelchair: where it stands; stations: marker boards on posts, by name. Both are poses of a dock frame: origin on
    the ground under the board, x the way a robot approaches. chargers: of stations, by their name.
    surfaces: reflectivity (0-1) of single solids, by name.
    glass: names of walls and boxes that are panes to LiDARs; physics and cameras treat them as their own kind.
    """

    note: str
    friction: Friction
    floor: Floor
    start: Place
    kerbs: list[Box] = []
    walls: list[Box] = []
    boxes: list[Box] = []
    cylinders: list[Cylinder] = []
    ramps: list[Ramp] = []
    patches: list[Patch] = []
    pits: list[Pit] = []
    people: list[Person] = []
    doors: list[Door] = []
    lifts: list[LiftCar] = []
    surfaces: dict[str, Annotated[float, Field(ge=0.0, le=1.0)]] = {}
    glass: list[str] = []
    routes: dict[str, Route] = {}
    wheelchair: Place | None = None
    stations: dict[str, Place] = {}
    chargers: dict[str, Charger] = {}

    @model_validator(mode="after")
    def _names_are_unique(self) -> WorldFile:
        names = [item.name for item in (*self.solids(), *self.ramps, *self.patches, *self.pits)]
        names += [*(item.name for item in self.cylinders), *self.stations]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"names used twice: {', '.join(twice)}")
        persons = [person.name for person in self.people]
        if len(set(persons)) < len(persons):
            raise ValueError(f"people: names used twice among {', '.join(persons)}")
        doors = [door.name for door in self.doors]
        if len(set(doors)) < len(doors):
            raise ValueError(f"doors: names used twice among {', '.join(doors)}")
        led = [stop.door for lift in self.lifts for stop in lift.stops]
        if len(set(led)) < len(led) or not set(led) <= set(doors):
            raise ValueError(f"lifts: each stop needs a door of its own, there are {', '.join(led)}")
        lost = sorted(set(self.chargers) - set(self.stations))
        if lost:
            raise ValueError(f"chargers: no station {', '.join(lost)}")
        unknown = sorted(set(self.surfaces) - set(names))
        if unknown:
            raise ValueError(f"surfaces: no solid {', '.join(unknown)}")
        clear = sorted(set(self.glass) - {item.name for item in (*self.walls, *self.boxes)})
        if clear:
            raise ValueError(f"glass: no wall or box {', '.join(clear)}")
        return self

    def solids(self) -> list[Box]:
        """All upright boxes of any kind."""
        return [*self.kerbs, *self.walls, *self.boxes]


def load_world(name: str) -> WorldFile:
    """``config/worlds/<name>.yaml``, or the file itself if ``name`` is a path.

    Raises ConfigError, for an unknown name with the names there are.
    """
    folder = config_dir() / "worlds"
    path = Path(name) if "/" in name else folder / f"{name}.yaml"
    if not path.is_file():
        known = ", ".join(sorted(path.stem for path in folder.glob("*.yaml")))
        raise ConfigError(f"no world {name!r} in {folder}; there are {known or 'none'}")
    return validate(WorldFile, read_yaml(path), str(path))

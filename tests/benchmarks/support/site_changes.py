"""A world that has changed since it was mapped, and people who walk in it. All from a seed; routes stay free."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.polyline import Polyline
from sim.worldfile import Box, Cylinder, Person, WorldFile
from tests.benchmarks.support.framework import BenchError

Array = NDArray[np.float64]
_CLEARANCE_M = 0.15  # beyond a route's half width
_WALKER_M = 1.0  # of a walker's line from every route: walkers do not stop, and the robot follows its route blindly
_TRIES = 200


@dataclass(frozen=True, slots=True)
class Changes:
    """Names of the removed, moved and added objects."""

    removed: tuple[str, ...]
    moved: tuple[str, ...]
    added: tuple[str, ...]


def changed_world(world: WorldFile, share: float, seed: int) -> tuple[WorldFile, Changes]:
    """``share`` of all boxes and cylinders removed or moved, half each, and as many added as were removed."""
    random = np.random.default_rng(seed)
    items: list[Box | Cylinder] = [*world.boxes, *world.cylinders]
    chosen = random.permutation(len(items))[: math.ceil(share * len(items))]
    removed, moved = chosen[: len(chosen) // 2], chosen[len(chosen) // 2 :]
    kept = [item for index, item in enumerate(items) if index not in set(chosen.tolist())]
    new = [_elsewhere(items[int(index)], world, random, 3.0) for index in moved]
    added = [
        _elsewhere(items[int(index)].model_copy(update={"name": f"new_{count}"}), world, random, math.inf)
        for count, index in enumerate(removed)
    ]
    everything = [*kept, *new, *added]
    changed = world.model_copy(
        update={
            "boxes": [item for item in everything if isinstance(item, Box)],
            "cylinders": [item for item in everything if isinstance(item, Cylinder)],
        }
    )
    return changed, Changes(
        tuple(items[int(index)].name for index in removed),
        tuple(item.name for item in new),
        tuple(item.name for item in added),
    )


def walkers(world: WorldFile, count: int, seed: int) -> list[Person]:
    """Persons who walk to and fro for 6-10 m beside the routes, 1.2-2.5 m off their middle, at 0.8-1.4 m/s."""
    random = np.random.default_rng(seed)
    routes = [np.array(route.points_m, float) for route in world.routes.values()]
    ways = [Polyline(route.points_m) for route in world.routes.values()]
    return [_walker(f"walker_{index}", routes[index % len(routes)], ways, random) for index in range(count)]


def _walker(name: str, route: Array, ways: Sequence[Polyline], random: np.random.Generator) -> Person:
    """Raises BenchError if no line beside the route keeps off all ways."""
    for _ in range(_TRIES):
        leg = int(random.integers(len(route) - 1))
        start, along = route[leg], route[leg + 1] - route[leg]
        length = float(np.hypot(*along))
        along = along / length
        side = random.choice([-1.0, 1.0]) * random.uniform(1.2, 2.5) * np.array([-along[1], along[0]])
        first = start + along * random.uniform(0.0, length) + side
        line = first + np.outer(np.linspace(0.0, random.uniform(6.0, 10.0), 30), along)
        if all(way.distance_m(x, y) > _WALKER_M for way in ways for x, y in line):
            points = [(float(x), float(y)) for x, y in (line[0], line[-1])]
            return Person(name=name, points_m=points, speed_mps=random.uniform(0.8, 1.4))
    raise BenchError(f"{name}: no line beside its route keeps off all routes")


def _elsewhere(item: Box | Cylinder, world: WorldFile, random: np.random.Generator, reach_m: float) -> Box | Cylinder:
    """The object at a free place within reach_m, or anywhere for None; at its old place if none is free."""
    floor = world.floor
    for _ in range(_TRIES):
        if math.isfinite(reach_m):
            x, y = item.x_m + random.uniform(-reach_m, reach_m), item.y_m + random.uniform(-reach_m, reach_m)
        else:
            x = random.uniform(floor.min_x_m + 1.0, floor.max_x_m - 1.0)
            y = random.uniform(floor.min_y_m + 1.0, floor.max_y_m - 1.0)
        if _free(x, y, _radius(item), world):
            turn = {"yaw_deg": random.uniform(-180.0, 180.0)} if isinstance(item, Box) else {}
            return item.model_copy(update={"x_m": x, "y_m": y, **turn})
    return item


def _radius(item: Box | Cylinder) -> float:
    return item.radius_m if isinstance(item, Cylinder) else 0.5 * math.hypot(item.length_m, item.width_m)


def _free(x: float, y: float, radius_m: float, world: WorldFile) -> bool:
    return all(
        Polyline(route.points_m).distance_m(x, y) > route.half_width_m + radius_m + _CLEARANCE_M
        for route in world.routes.values()
    )

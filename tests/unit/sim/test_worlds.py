"""World files: rejected content, and the geometry of the ground."""

from __future__ import annotations

import itertools
import math
from typing import Any

import mujoco
import numpy as np
import pytest

from robot_stack.core.config import ConfigError, config_dir, read_yaml, validate
from robot_stack.core.geometry import Pose2
from sim.plant.surface import Area, Surface
from sim.plant.world import Setup, World
from sim.worldfile import Ramp, WorldFile, load_world

from .bench import PARAMS, ROBOT

WORLDS = sorted(path.stem for path in (config_dir() / "worlds").glob("*.yaml"))
MINIMAL: dict[str, Any] = {
    "note": "test",
    "friction": 0.8,
    "floor": {"min_x_m": -1, "max_x_m": 1, "min_y_m": -1, "max_y_m": 1},
    "start": {"x_m": 0, "y_m": 0, "yaw_deg": 0},
}


def make_world(name: str) -> World:
    file = load_world(name)
    return World(ROBOT, PARAMS, Setup(file, 1, Pose2(-100.0, 0.0, 0.0)))


def height_at(world: World, x: float, y: float) -> float:
    """Returns the height of the topmost surface, by a ray straight down from 10 m."""
    hit = np.zeros(1, np.int32)
    groups = np.array([1, 0, 0, 0, 0, 0], np.uint8)
    start, down = np.array([x, y, 10.0]), np.array([0.0, 0.0, -1.0])
    distance = mujoco.mj_ray(world.model, world.data, start, down, groups, 1, -1, hit)
    return 10.0 - float(distance)


def ramps() -> list[tuple[str, Ramp]]:
    return [(name, ramp) for name in WORLDS for ramp in load_world(name).ramps]


@pytest.mark.parametrize("name", WORLDS)
def test_every_world_builds_and_the_robot_stands_in_it(name: str) -> None:
    file = load_world(name)
    world = World(ROBOT, PARAMS, Setup(file, 1, file.start.pose()))
    for _ in range(300):
        world.step()
    assert world.truth().pose().distance_to(file.start.pose()) < 1e-3
    assert world.normal_forces_n().sum() == pytest.approx(ROBOT.mass_kg * 9.81, rel=0.02)


@pytest.mark.parametrize(("name", "ramp"), ramps())
def test_a_ramp_rises_at_its_slope_to_its_flat_top(name: str, ramp: Ramp) -> None:
    world = make_world(name)

    def along(distance_m: float, across_m: float = 0.0) -> float:
        c, s = math.cos(ramp.yaw_rad), math.sin(ramp.yaw_rad)
        return height_at(world, ramp.x_m + c * distance_m - s * across_m, ramp.y_m + s * distance_m + c * across_m)

    run = ramp.height_m / math.tan(math.radians(ramp.slope_deg))
    assert along(-0.1) == pytest.approx(0.0, abs=1e-6)
    for part in (0.1, 0.5, 0.9):
        assert along(part * run) == pytest.approx(part * ramp.height_m, abs=1e-4)
        assert along(2 * run + ramp.top_length_m - part * run) == pytest.approx(part * ramp.height_m, abs=1e-4)
    assert along(run + 0.5 * ramp.top_length_m, 0.45 * ramp.width_m) == pytest.approx(ramp.height_m, abs=1e-6)
    assert along(2 * run + ramp.top_length_m + 0.1) == pytest.approx(0.0, abs=1e-6)
    for kerb in load_world(name).kerbs:
        assert height_at(world, kerb.x_m, kerb.y_m) == pytest.approx(kerb.height_m, abs=1e-6)


@pytest.mark.parametrize("name", [name for name in WORLDS if load_world(name).routes])
def test_routes_are_free_of_obstacles(name: str) -> None:
    """Within its half width a route meets only flat ground or a ramp that it climbs."""
    world, file = make_world(name), load_world(name)
    for route in file.routes.values():
        for (x0, y0), (x1, y1) in zip(route.points_m, route.points_m[1:], strict=False):
            length = math.hypot(x1 - x0, y1 - y0)
            c, s = (x1 - x0) / length, (y1 - y0) / length
            for d in np.arange(0.0, length, 0.1):
                level = height_at(world, x0 + c * d, y0 + s * d)
                for side in np.linspace(-route.half_width_m, route.half_width_m, 13):
                    here = height_at(world, x0 + c * d - s * side, y0 + s * d + c * side)
                    assert here == pytest.approx(level, abs=1e-3), (
                        f"({x0 + c * d:.1f}, {y0 + s * d:.1f}), {side:.1f} m aside"
                    )
                assert level < 0.5


@pytest.mark.parametrize("name", [name for name in WORLDS if load_world(name).routes and load_world(name).pits])
def test_routes_keep_off_the_pits(name: str) -> None:
    file = load_world(name)
    for pit in file.pits:
        area = Area(pit.x_m, pit.y_m, pit.yaw_rad, 0.5 * pit.length_m + 0.1, 0.5 * pit.width_m + 0.1, 1.0)
        for route in file.routes.values():
            for (x0, y0), (x1, y1) in itertools.pairwise(route.points_m):
                length = math.hypot(x1 - x0, y1 - y0)
                c, s = (x1 - x0) / length, (y1 - y0) / length
                for d, side in itertools.product(
                    np.arange(0.0, length, 0.1), (-route.half_width_m, 0.0, route.half_width_m)
                ):
                    assert not area.contains(x0 + c * d - s * side, y0 + s * d + c * side), f"{pit.name} at {d:.1f}"


def test_the_site_ride_follows_its_route_of_150_m() -> None:
    points = load_world("yard").routes["site_ride"].points_m
    legs = list(itertools.pairwise(points))
    assert sum(math.dist(a, b) for a, b in legs) == pytest.approx(150.0, abs=2.0)
    for waypoint in read_yaml(config_dir() / "missions" / "site_ride.yaml")["waypoints"]:
        here = np.array([waypoint["x"], waypoint["y"]])
        off = []
        for a, b in legs:
            along = np.subtract(b, a)
            share = np.clip(np.dot(here - a, along) / np.dot(along, along), 0.0, 1.0)
            off.append(float(np.linalg.norm(here - a - share * along)))
        assert min(off) < 0.6, f"{waypoint['name']} is {min(off):.2f} m off the route"


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"friction": 0.0}, "friction"),
        ({"floor": {"min_x_m": 1, "max_x_m": -1, "min_y_m": -1, "max_y_m": 1}}, "max_x_m"),
        (
            {"walls": [{"name": "w", "x_m": 0, "y_m": 0, "length_m": -1, "width_m": 1, "height_m": 1}]},
            "walls.0.length_m",
        ),
        ({"routes": {"a": {"half_width_m": 1, "points_m": [[0, 0]]}}}, "routes.a.points_m"),
        (
            {"cylinders": [{"name": "c", "x_m": 0, "y_m": 0, "radius_m": 1, "height_m": 1}] * 2},
            "names used twice: c",
        ),
    ],
)
def test_a_wrong_world_file_is_refused_with_the_field(change: dict[str, Any], field: str) -> None:
    with pytest.raises(ConfigError, match=r"no world 'moon'.*flat.*yard"):
        load_world("moon")
    with pytest.raises(ConfigError, match=field):
        validate(WorldFile, {**MINIMAL, **change}, "test.yaml")


def test_the_most_slippery_area_counts() -> None:
    file = validate(
        WorldFile,
        {
            **MINIMAL,
            "patches": [{"name": "p", "x_m": 5, "y_m": 0, "yaw_deg": 90, "length_m": 4, "width_m": 1, "friction": 0.3}],
        },
        "test",
    )
    surface = Surface(file)
    assert surface.friction_at(0.0, 0.0, 0) == 0.8
    assert surface.friction_at(5.0, 1.9, 0) == 0.3, "turned by 90 degrees its length lies along y"
    assert surface.friction_at(5.9, 0.0, 0) == 0.8
    surface.add_area("ice", Area(5.0, 0.0, 0.0, 1.0, 1.0, 0.1))
    assert surface.friction_at(5.0, 0.5, 0) == 0.1
    surface.remove_area("ice")
    assert surface.friction_at(5.0, 0.5, 0) == 0.3
    surface.set_wheel(2, 0.05)
    assert surface.friction_at(0.0, 0.0, 2) == 0.05
    assert surface.friction_at(0.0, 0.0, 1) == 0.8
    surface.set_wheel(2, None)
    assert surface.friction_at(0.0, 0.0, 2) == 0.8


def test_the_missions_of_the_yard_stay_on_free_ground() -> None:
    """Straight lines between the waypoints of each mission without a dock, 0.8 m to either side.

    A mission with a route of its own name is meant for a planner: its path is that route.
    """
    world, routes = make_world("yard"), load_world("yard").routes
    for path in sorted((config_dir() / "missions").glob("*.yaml")):
        mission = read_yaml(path)
        if path.stem in routes:
            continue
        if any("dock" in str(waypoint["action"]) for waypoint in mission["waypoints"]):
            continue
        points = [(0.0, 0.0), *((waypoint["x"], waypoint["y"]) for waypoint in mission["waypoints"])]
        for (x0, y0), (x1, y1) in itertools.pairwise(points):
            length = math.hypot(x1 - x0, y1 - y0)
            c, s = (x1 - x0) / length, (y1 - y0) / length
            for d in np.arange(0.0, length, 0.1):
                for side in np.linspace(-0.8, 0.8, 9):
                    height = height_at(world, x0 + c * d - s * side, y0 + s * d + c * side)
                    assert height == pytest.approx(0.0, abs=1e-6), f"{path.stem} at {x0 + c * d:.1f}, {y0 + s * d:.1f}"

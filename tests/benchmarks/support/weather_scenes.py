"""A standing robot in rain, snow, dust or a low sun, with a given number of false returns, and a bystander."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from robot_stack.contract import frames
from robot_stack.core.robot import load_robot
from sim.camera.motion import Track, still
from sim.lidar import labels
from sim.lidar.kernels import FIRST_SOLID
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import Scene, build_scene
from sim.lidar.sensor import CLEAR, Conditions, Lidar, Sweep
from sim.lidar.shapes import BOX, CYLINDER, Shape, pack
from sim.lidar.sun import Sun
from sim.lidar.weather import Kind, Weather
from sim.params import load_sim_params
from sim.worldfile import WorldFile, load_world

AMOUNTS: dict[Kind, float] = {"rain": 25.0, "snow": 1.0, "dust": 100.0}
SUN = "sun"
KINDS = (*AMOUNTS, SUN)
ASIDE = 0.15  # y of a bystander over its x, away from the seam of half sweeps
_LOW_SUN = Sun(math.degrees(math.atan(ASIDE)))  # directly behind the bystander
_WHO = "bystander"
_ROUNDS, _SWEEPS, _TUNING_SEED = 4, 4, 900


@dataclass(frozen=True, slots=True)
class Bystander:
    """An upright cylinder, or a bar across. light: reflectivity; a dark, wet coat 0.05."""

    name: str
    radius_m: float
    height_m: float
    light: float = 0.3


@dataclass
class Shower:
    """Half sweeps in one weather, or into the sun. fewer_of_bystander: kept share of the bystander's returns."""

    lidar: Lidar
    base: Track
    conditions: Conditions
    at: Track | None = None
    absent: bool = False
    fewer_of_bystander: float = 1.0
    _counts: list[int] = field(default_factory=list)

    def half_sweep(self, stamp_s: float, half: int) -> Sweep:
        """Robot and bystander stand, so their tracks do not depend on the time."""
        movers = {} if self.at is None or self.absent else {_WHO: self.at}
        sweep = self.lidar.half_sweep(self.base, stamp_s, half, movers, self.conditions)
        self._counts.append(int((sweep.labels == labels.AIRBORNE).sum()))
        if self.fewer_of_bystander < 1.0:
            draws = np.random.default_rng(len(self._counts)).random(len(sweep.labels))
            kept = (sweep.labels != labels.PERSON) | (draws < self.fewer_of_bystander)
            return replace(sweep, points=sweep.points[kept], labels=sweep.labels[kept])
        return sweep

    def mean_airborne(self) -> float:
        """Mean airborne returns in a full sweep so far."""
        return 2.0 * float(np.mean(self._counts))


def shower(kind: Kind | str, returns: float, seed: int, world: str = "flat") -> Shower:
    """kind "clear": none. returns: airborne returns in a full sweep of that world."""
    lidar = Lidar(scene_of(world), load_lidar_params(), load_robot(), seed)
    return Shower(lidar, start_of(world), conditions_of(kind, returns, world))


def with_bystander(
    weather: Shower, who: Bystander, x_m: float, y_m: float = 0.0, lying_m: float | None = None
) -> Shower:
    """Adds a bystander at (x_m, y_m) in base_link on a plain. lying_m: height of a bar across instead."""
    params = load_lidar_params()
    half_m = 0.5 * who.height_m
    r_m = who.radius_m
    if lying_m is None:
        shape = Shape(CYLINDER, (0.0, 0.0, half_m), (r_m, r_m, half_m), labels.PERSON, who.light)
    else:
        shape = Shape(BOX, (0.0, 0.0, lying_m), (r_m, half_m, r_m), labels.PERSON, who.light)
    shapes = pack([], [[shape]])
    ground = scene_of("flat")
    scene = Scene(
        shapes,
        (_WHO,),
        ground.rects,
        np.concatenate([ground.label[:FIRST_SOLID], shapes.label]),
        np.concatenate([ground.reflectivity[:FIRST_SOLID], shapes.reflectivity]),
    )
    place = np.eye(4)
    place[:2, 3] = x_m, y_m
    lidar = Lidar(scene, params, load_robot(), weather.lidar.seed)
    return replace(weather, lidar=lidar, at=still(place), _counts=[])


@cache
def conditions_of(kind: Kind | str, returns: float, world: str) -> Conditions:
    """The weather with its density tuned so that a sweep holds ``returns``, by a seed of its own."""
    if kind == "clear":
        return CLEAR
    lidar = Lidar(scene_of(world), load_lidar_params(), load_robot(), _TUNING_SEED)
    factor = 1.0
    for _ in range(_ROUNDS):
        conditions = _conditions(kind, factor)
        sweeps = [lidar.sweep(start_of(world), 0.0, conditions=conditions) for _ in range(_SWEEPS)]
        factor *= returns / max(float(np.mean([(sweep.labels == labels.AIRBORNE).sum() for sweep in sweeps])), 1.0)
    return _conditions(kind, factor)


def _conditions(kind: Kind | str, factor: float) -> Conditions:
    """The sun's azimuth requires that the robot looks along x."""
    if kind == SUN:
        return Conditions(sun=replace(_LOW_SUN, returns_factor=factor))
    assert kind in AMOUNTS
    return Conditions(weather=Weather(kind, AMOUNTS[kind], factor))


@cache
def scene_of(world: str) -> Scene:
    """Without people; the wheelchair is elsewhere."""
    return build_scene(load_world(world), load_lidar_params(frames.LIDAR), load_sim_params().wheelchair)


def start_of(world: str) -> Track:
    """The start pose of the world's file."""
    place, start = np.eye(4), load_world(world).start
    place[:2, 3] = start.x_m, start.y_m
    c, s = np.cos(np.radians(start.yaw_deg)), np.sin(np.radians(start.yaw_deg))
    place[:2, :2] = [[c, -s], [s, c]]
    return still(place)


def of_world(kind: Kind | str, returns: float, seed: int, world: WorldFile) -> Shower:
    """A plain with objects on it, in the weather conditions of the empty plain."""
    params = load_lidar_params()
    scene = build_scene(world, params, load_sim_params().wheelchair)
    return Shower(Lidar(scene, params, load_robot(), seed), start_of("flat"), conditions_of(kind, returns, "flat"))

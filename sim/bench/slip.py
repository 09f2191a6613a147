"""A ride on ice: how far off is the pose while wheels slip, with and without the map's way beside theirs?"""

from __future__ import annotations

import math
from typing import Any

from robot_stack.bench.framework import Aim, Result
from robot_stack.core.config import config_dir, load, read_yaml
from robot_stack.core.site_map import Cells
from robot_stack.safety.params import SafetyParams
from sim.bench.lidar_stack import Fix, LidarStack, RouteFollower
from sim.bench.site_map import site_cells
from sim.plant.world import Setup
from sim.worldfile import Patch, WorldFile, load_world

NAME = "slip"
AIMS = {
    "error_max_m": Aim("<", 0.15),
    "stops": Aim("<=", 0.0),
    "false_alarms": Aim("<=", 0.0),
}
_WITHOUT_M = 1e6  # ways never are so far apart


def run(friction: float = 0.02, seconds: float = 40.0, speed_mps: float = 1.2, seed: int = 1) -> Result:
    """friction: of the ice, everywhere. seconds: of each ride along the yard's lap; dry, then twice on ice."""
    world = load_world("yard")
    cells, origin = site_cells(world, "yard", seed=1000)
    rides = {
        name: _Ride(ground, cells, seed, least_m).drive(world.routes["lap"].points_m, speed_mps, seconds)
        for name, ground, least_m in (
            ("dry", world, None),
            ("ice", icy(world, friction), None),
            ("without", icy(world, friction), _WITHOUT_M),
        )
    }
    ice, without = rides["ice"], rides["without"]
    figures = {
        "error_max_m": ice.error_max_m,
        "error_rms_m": ice.error_rms_m,
        "stops": float(ice.stops),
        "told_pct": 100.0 * ice.told / len(ice.fixes),
        "false_alarms": float(rides["dry"].told),
        "dry_error_max_m": rides["dry"].error_max_m,
        "without_error_max_m": without.error_max_m,
        "without_error_rms_m": without.error_rms_m,
        "without_stops": float(without.stops),
    }
    return Result(
        figures,
        {
            "map": origin,
            "friction": friction,
            "world": "yard, lockstep physics and LiDAR; along the lap by the pose that is believed",
            "error": "published pose (10 Hz) against the truth at its stamp",
            "stops": "poses whose quality is below the safety monitor's limit",
            "told_pct": "share of the poses at which a slip is told",
            "false_alarms": "the same on dry ground, their number",
            "without": "the same ride, where the map's way is never compared with the wheels'",
            "seed": seed,
            "speed_mps": speed_mps,
        },
    )


def icy(world: WorldFile, friction: float) -> WorldFile:
    """The same world with ice everywhere."""
    ground = world.floor
    ice = Patch(
        name="ice",
        x_m=0.5 * (ground.min_x_m + ground.max_x_m),
        y_m=0.5 * (ground.min_y_m + ground.max_y_m),
        length_m=ground.max_x_m - ground.min_x_m,
        width_m=ground.max_y_m - ground.min_y_m,
        friction=friction,
    )
    return world.model_copy(update={"patches": [ice]})


class _Ride:
    """least_m: from where on ways that are apart are a slip; None: as configured."""

    def __init__(self, world: WorldFile, cells: Cells, seed: int, least_m: float | None) -> None:
        start = world.start.pose()
        changes = {} if least_m is None else _with_least(least_m)
        self._stack = LidarStack(Setup(world, seed, start), cells, start, changes=changes)
        self._stack.settle()
        self._from = len(self._stack.fixes)
        self.told = 0

    def drive(self, points: list[tuple[float, float]], speed_mps: float, seconds: float) -> _Ride:
        """Until the route or the time ends."""
        follower = self._stack.follower = RouteFollower(points, speed_mps)
        self._stack.every(10.0, self._note)
        self._stack.run(lambda: follower.ended, seconds)
        return self

    def _note(self) -> None:
        self.told += self._stack.map_localizer.slip is not None

    @property
    def fixes(self) -> list[Fix]:
        return self._stack.fixes[self._from :]

    @property
    def error_max_m(self) -> float:
        return max(fix.error_m for fix in self.fixes)

    @property
    def error_rms_m(self) -> float:
        return math.sqrt(sum(fix.error_m**2 for fix in self.fixes) / len(self.fixes))

    @property
    def stops(self) -> int:
        limit = load(SafetyParams, "safety_monitor").lost_quality
        return sum(fix.quality < limit for fix in self.fixes)


def _with_least(least_m: float) -> dict[str, Any]:
    ndt = read_yaml(config_dir() / "ndt_localization.yaml")["ndt"]
    return {"ndt": {**ndt, "slip": {**ndt["slip"], "least_m": least_m}}}

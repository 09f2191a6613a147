"""A ride on ice: how far off is the pose while wheels slip, with and without the map's way beside theirs?"""

from __future__ import annotations

import math

from robot_stack.core.config import load
from robot_stack.safety.params import SafetyParams
from sim.worldfile import Patch, WorldFile, load_world
from tests.benchmarks.support.framework import Aim, Result
from tests.benchmarks.support.lidar_ride import LidarRide, RouteFollower

AIMS = {
    "error_max_m": Aim("<", 0.15),
    "stops": Aim("<=", 0.0),
    "false_alarms": Aim("<=", 0.0),
}
_WITHOUT_M = 1e6  # greater than any difference, so no slip is detected


def run(friction: float = 0.02, seconds: float = 40.0, speed_mps: float = 1.2, seed: int = 1) -> Result:
    """friction: of the ice, everywhere. seconds: of each ride along the yard's lap; one dry, then two on ice."""
    world = load_world("yard")
    lap = world.routes["lap"].points_m
    # People of the yard would block the route.
    world = world.model_copy(update={"people": []})
    rides = {
        name: _Ride(ground, seed, least_m, lap, speed_mps, seconds)
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
        "told_pct": 100.0 * ice.shown / len(ice.fixes),
        "false_alarms": float(rides["dry"].shown),
        "dry_error_max_m": rides["dry"].error_max_m,
        "without_error_max_m": without.error_max_m,
        "without_error_rms_m": without.error_rms_m,
        "without_stops": float(without.stops),
    }
    return Result(
        figures,
        {
            "map": "config/maps/yard, from a recorded ride",
            "friction": friction,
            "world": "yard; five nodes on the deterministic scheduler, the safety monitor is played; "
            "along the lap by the estimated pose",
            "error": "published pose (10 Hz) against the truth at its stamp",
            "stops": "poses whose quality is below the safety monitor's limit",
            "told_pct": "share of the poses at which a slip is reported",
            "false_alarms": "the same on dry ground, their number",
            "without": "the same ride without the comparison of map and wheels",
            "seed": seed,
            "speed_mps": speed_mps,
        },
    )


def icy(world: WorldFile, friction: float) -> WorldFile:
    """The world with ice on the whole ground."""
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
    """The fixes of a ride along the points, until the route or the time ends.

    least_m: least difference of the ways that counts as a slip; None: as configured.
    """

    def __init__(
        self,
        world: WorldFile,
        seed: int,
        least_m: float | None,
        points: list[tuple[float, float]],
        speed_mps: float,
        seconds: float,
    ) -> None:
        settings = [] if least_m is None else [f"ndt_localization.ndt.slip.least_m={least_m}"]
        with LidarRide(seed, world, "yard", world.start.pose(), *settings) as stack:
            begin = len(stack.fixes)
            follower = stack.follower = RouteFollower(points, speed_mps)
            stack.scheduler.run_for(seconds, lambda: follower.ended)
            self.fixes = stack.fixes[begin:]

    @property
    def shown(self) -> int:
        return sum(fix.slips for fix in self.fixes)

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

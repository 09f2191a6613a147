"""How well the pose is known on a long ride: physics, LiDAR, people walking, a site that has changed since its map."""

from __future__ import annotations

import itertools
import math
from dataclasses import asdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Pose2
from robot_stack.localization.ndt.gate import Confidence
from sim.worldfile import WorldFile, load_world
from tests.benchmarks.support.framework import Aim, BenchError, Result
from tests.benchmarks.support.lidar_ride import Fix, LidarRide, RouteFollower, way_m
from tests.benchmarks.support.site_changes import changed_world, walkers

Array = NDArray[np.float64]

AIMS = {
    "rms_m": Aim("<", 0.05),
    "p95_m": Aim("<", 0.08),
    "yaw_deg_p95": Aim("<", 0.3),
    "length_m": Aim(">=", 500.0),
}
_LEG_LIMIT_FACTOR = 3.0


def run(
    length_m: float = 520.0,
    speed_mps: float = 1.2,
    changed_share: float = 0.2,
    people: int = 8,
    seed: int = 1,
    world: str = "yard",
    pictures: str = "results/ride",
) -> Result:
    """The start pose is 1 m and 10 deg wrong. changed_share: share of the boxes and cylinders changed since the map."""
    mapped = load_world(world)
    changed, changes = changed_world(mapped, changed_share, seed)
    present = changed.model_copy(update={"people": walkers(mapped, people, seed)})
    start = mapped.start.pose().compose(Pose2(0.7, -0.7, math.radians(10.0)))
    with LidarRide(seed, present, world, start) as stack:
        found_s = next(fix.time_s for fix in stack.fixes if fix.confidence is Confidence.TRACKING)
        found_s -= stack.localized_from_s
        fixes = _drive(stack, mapped, length_m, speed_mps)
    errors = _Errors(fixes)
    _picture(errors, present, Path(pictures))
    return Result(
        errors.figures() | {"start_found_s": found_s},
        {
            "map": f"config/maps/{world}, from a recorded ride",
            "world": "five nodes on the deterministic scheduler, the safety monitor is played",
            "changed": {name: list(names) for name, names in asdict(changes).items()},
            "people": f"{people}, to and fro beside the routes, 1 m off them and more",
            "start": "1 m and 10 deg wrong; the ride begins when the pose is confirmed",
            "error": "published pose (10 Hz) against the truth at its stamp",
            "seed": seed,
            "speed_mps": speed_mps,
        },
    )


def _drive(stack: LidarRide, world: WorldFile, length_m: float, speed_mps: float) -> list[Fix]:
    """Drives different routes in sequence until the distance is reached."""
    begin = len(stack.fixes)
    names = [name for name in ("site_ride", "lap", "tour") if name in world.routes]
    if not names:
        raise BenchError("the world has no routes that begin and end where the robot starts")
    count = 0
    while way_m(stack.fixes[begin:]) < length_m:
        name = names[count % len(names)]
        points = world.routes[name].points_m
        follower = stack.follower = RouteFollower(points, speed_mps)
        limit_s = _LEG_LIMIT_FACTOR * sum(math.dist(a, b) for a, b in itertools.pairwise(points))
        stack.run(lambda f=follower: f.ended, limit_s / speed_mps, f"route {name} not finished")  # type: ignore[misc]
        count += 1
    return stack.fixes[begin:]


class _Errors:
    """Errors of the published poses along the way."""

    def __init__(self, fixes: list[Fix]) -> None:
        known = [fix for fix in fixes if fix.pose is not None]
        self.fixes, self.unknown = known, len(fixes) - len(known)
        rows = []
        for fix in known:
            assert fix.pose is not None
            off = fix.pose.relative_to(fix.truth)
            rows.append((off.x, off.y, math.degrees(math.remainder(off.yaw, math.tau))))
        self.along, self.across, self.yaw_deg = np.array(rows).T
        self.position = np.hypot(self.along, self.across)
        steps = [0.0] + [a.truth.distance_to(b.truth) for a, b in itertools.pairwise(known)]
        self.way = np.cumsum(steps)

    def figures(self) -> dict[str, float]:
        return {
            "rms_m": float(np.sqrt(np.mean(self.position**2))),
            "p95_m": float(np.percentile(self.position, 95)),
            "max_m": float(self.position.max()),
            "yaw_deg_p95": float(np.percentile(np.abs(self.yaw_deg), 95)),
            "yaw_deg_max": float(np.abs(self.yaw_deg).max()),
            "length_m": float(self.way[-1]),
            "along_bias_m": float(self.along.mean()),
            "across_bias_m": float(self.across.mean()),
            "quality_min": min(fix.quality for fix in self.fixes),
            "score_min": min(fix.score for fix in self.fixes),
            "not_published": float(self.unknown),
            "highest_m": max(fix.height_m for fix in self.fixes),
        }


def _picture(errors: _Errors, world: WorldFile, folder: Path) -> None:
    from matplotlib.figure import Figure

    from sim.pictures.ride_plots import draw_world

    folder.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(12, 9), layout="constrained")
    top, middle, bottom = figure.subplots(3, 1, height_ratios=[3, 1, 1])
    x, y = (np.array([getattr(fix.truth, axis) for fix in errors.fixes]) for axis in "xy")
    dots = top.scatter(x, y, c=1e3 * errors.position, s=4, cmap="viridis")
    draw_world(top, world)
    figure.colorbar(dots, ax=top, label="error, mm")
    top.set_aspect("equal")
    middle.plot(errors.way, 1e3 * errors.along, lw=0.7, label="along")
    middle.plot(errors.way, 1e3 * errors.across, lw=0.7, label="across")
    middle.set_ylabel("mm")
    middle.legend()
    bottom.plot(errors.way, errors.yaw_deg, lw=0.7, label="yaw, deg")
    bottom.plot(errors.way, [fix.score for fix in errors.fixes], lw=0.7, label="score")
    bottom.plot(errors.way, [fix.quality for fix in errors.fixes], lw=0.7, label="quality")
    bottom.set_xlabel("way, m")
    bottom.legend()
    figure.savefig(folder / "ride.png", dpi=90)

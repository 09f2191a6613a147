"""A ride over open ground, nothing within the LiDAR's reach: does the robot go on, and how far off is it at the end?"""

from __future__ import annotations

import itertools
import math
import tempfile
from pathlib import Path

import numpy as np

from robot_stack.core.config import load
from robot_stack.core.geometry import Pose2
from robot_stack.core.site_map import Grid, SiteMap, save_map
from robot_stack.localization.ndt.gate import Confidence
from robot_stack.safety.params import SafetyParams
from sim.worldfile import Box, Floor, Place, Route, WorldFile
from tests.benchmarks.support.framework import Aim, Result
from tests.benchmarks.support.lidar_ride import Fix, LidarRide, RouteFollower, way_m
from tests.benchmarks.support.site_map import cells_at_true_poses

AIMS = {
    "stops": Aim("<=", 0.0),
    "error_at_end_m": Aim("<", 0.3),
}
_SIGHT_M = 50.0  # range of the LiDAR and of the matcher
_BIAS_S = 3.0
_BEFORE_M, _AFTER_M = 6.0, 10.0


def run(apron_m: float = 24.0, speed_mps: float = 1.2, seed: int = 1) -> Result:
    """apron_m: length of the way with nothing in range. A match needs the structure some 2 m nearer."""
    ride = _Ride(apron_m, speed_mps, seed, _AFTER_M)
    figures = {
        "stops": float(ride.stops()),
        "error_at_end_m": max((fix.error_m for fix in ride.blind()), default=math.nan),
        "blind_way_m": way_m(ride.blind()),
        "quality_min": min(fix.quality for fix in ride.fixes),
        "error_over_sigma_max": max((fix.error_m / fix.sigma_m for fix in ride.blind()), default=math.nan),
        "error_after_m": ride.fixes[-1].error_m,
    }
    return Result(
        figures,
        {
            "world": f"two yards {apron_m + 2.0 * _SIGHT_M:.0f} m apart, even asphalt between them; five nodes on the "
            f"deterministic scheduler, the safety monitor is played; LiDAR to {_SIGHT_M:.0f} m",
            "map": "made from sweeps at true poses, within 30 m of each yard",
            "stops": "how often the quality fell below the safety monitor's limit",
            "error_at_end_m": "largest error of the published pose while it was dead reckoning",
            "seed": seed,
            "speed_mps": speed_mps,
        },
    )


class _Ride:
    """A ride by the estimated pose from within range of the first yard over the apron.

    beyond_m: how far past the end of the apron.
    """

    def __init__(self, apron_m: float, speed_mps: float, seed: int, beyond_m: float) -> None:
        begin_m, end_m = _SIGHT_M - _BEFORE_M, _SIGHT_M + apron_m
        start = Pose2(begin_m, 0.0, 0.0)
        world = _world(apron_m, start)
        # Only navigation uses the grid, and it does not run here.
        nothing = Grid(1.0, 0.0, 0.0, np.zeros((1, 1), np.int8))
        with tempfile.TemporaryDirectory() as folder:
            save_map(SiteMap("lost", cells_at_true_poses(world, 1000 * seed), nothing), Path(folder))
            with LidarRide(seed, world, folder, start) as stack:
                # The gyro bias is estimated at standstill, as before any ride.
                stack.scheduler.run_for(_BIAS_S)
                begin = len(stack.fixes)
                points = [(begin_m, 0.0), (end_m + beyond_m, 0.0)]
                follower = stack.follower = RouteFollower(points, speed_mps)
                limit_s = 3.0 * (points[1][0] - points[0][0]) / speed_mps
                stack.run(
                    lambda: follower.ended or stack.confidence is Confidence.SEARCHING, limit_s, "the ride did not end"
                )
                stack.follower = None
                stack.scheduler.run_for(1.0)
                self.fixes = stack.fixes[begin:]

    def blind(self) -> list[Fix]:
        return [fix for fix in self.fixes if fix.confidence is Confidence.DEAD_RECKONING]

    def stops(self) -> int:
        limit = load(SafetyParams, "safety_monitor").lost_quality
        below = [fix.quality < limit for fix in self.fixes]
        return sum(not a and b for a, b in itertools.pairwise([False, *below]))


def _world(apron_m: float, start: Pose2) -> WorldFile:
    """A yard west of x = 0, one just out of range east of the apron, and a route between them for the map."""
    far_m = apron_m + 2.0 * _SIGHT_M
    boxes = [
        Box(name=f"{side}_{index}", x_m=x, y_m=y, yaw_deg=yaw, length_m=length, width_m=width, height_m=3.0)
        for side, sign, from_m in (("west", -1.0, 0.0), ("east", 1.0, far_m))
        for index, (x, y, yaw, length, width) in enumerate(
            (from_m + sign * away, y, yaw, length, width)
            for away, y, yaw, length, width in (
                (1.0, 9.0, 90.0, 12.0, 0.3),
                (3.0, -8.0, 70.0, 9.0, 0.3),
                (4.0, 1.0, 0.0, 3.0, 2.0),
                (9.0, -1.0, 90.0, 8.0, 0.3),
            )
        )
    ]
    return WorldFile(
        note="Two yards and open ground between them.",
        friction=0.8,
        floor=Floor(min_x_m=-20.0, max_x_m=far_m + 20.0, min_y_m=-25.0, max_y_m=25.0),
        start=Place(x_m=start.x, y_m=start.y, yaw_deg=0.0),
        boxes=boxes,
        routes={
            "west": Route(half_width_m=1.0, points_m=[(5.0, 0.0), (30.0, 0.0)]),
            "east": Route(half_width_m=1.0, points_m=[(far_m - 30.0, 0.0), (far_m - 5.0, 0.0)]),
        },
    )

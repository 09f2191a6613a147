"""Drift of odometry on a ride and the remaining error in the map."""

from __future__ import annotations

import math

import numpy as np

from robot_stack.mapping.build import Built
from robot_stack.mapping.poses import Floats, difference, inverse


def distance_m(poses: Floats) -> float:
    """Length of the way, m."""
    return float(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum())


def drift(built: Built) -> dict[str, object]:
    """Drift at loops and at the end of the ride, for map.yaml: plain numbers."""

    def misses(poses: Floats) -> list[tuple[float, float]]:
        found = []
        for loop in built.loops:
            d = difference(inverse(poses[loop.earlier]) @ poses[loop.later], loop.measured)
            found.append((round(math.hypot(d[0], d[1]), 4), round(math.degrees(abs(d[5])), 3)))
        return found

    ways = {"wheel_odometry": built.by_wheels, "lidar_odometry": built.by_lidar, "map": built.poses}
    by = {name: misses(poses) for name, poses in ways.items()}
    end = {
        f"{name}_end_error_m": round(float(np.linalg.norm((poses[-1] - built.poses[-1])[:2, 3])), 4)
        for name, poses in ways.items()
        if name != "map"
    }
    loops = [
        {
            "from_s": round(float(built.stamps_s[loop.earlier] - built.stamps_s[0]), 1),
            "to_s": round(float(built.stamps_s[loop.later] - built.stamps_s[0]), 1),
            "fit": round(loop.share, 3),
            **{f"{name}_m": by[name][k][0] for name in ways},
            **{f"{name}_deg": by[name][k][1] for name in ways},
        }
        for k, loop in enumerate(built.loops)
    ]
    worst = {f"{name}_worst_loop_m": max((miss[0] for miss in by[name]), default=0.0) for name in ways}
    return {"loops_closed": len(loops), **end, **worst, "loops": loops}

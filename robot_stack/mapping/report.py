"""Drift of odometry on a ride and the remaining error in the map."""

from __future__ import annotations

import math

import numpy as np

from robot_stack.mapping.build import Built
from robot_stack.mapping.course import Course
from robot_stack.mapping.loops import Loop
from robot_stack.mapping.poses import Floats, difference, inverse


def lengths(course: Course) -> tuple[float, float]:
    """(length of the way m, duration s) of all rides together."""
    parts = [np.flatnonzero(course.ride == number) for number in range(int(course.ride[-1]) + 1)]
    way = sum(float(np.linalg.norm(np.diff(course.poses[part, :3, 3], axis=0), axis=1).sum()) for part in parts)
    return way, sum(float(np.ptp(course.stamps_s[part])) for part in parts)


def rides_of(built: Built) -> list[dict[str, object]]:
    """The rides in the order of joining, for map.yaml."""
    overlaps: list[dict[str, object]] = [
        {
            "loops_with_those_before": overlap.loops,
            "walls_of_both": overlap.walls,
            "walls_apart_rms_m": None if math.isnan(overlap.rms_m) else round(overlap.rms_m, 4),
        }
        for overlap in built.overlaps
    ]
    return [
        {"recording": name, "sweeps": int((built.course.ride == number).sum()), **found}
        for number, (name, found) in enumerate(zip(built.names, [{}, *overlaps], strict=True))
    ]


def drift(built: Built) -> dict[str, object]:
    """Drift at loops and at the end of the rides, for map.yaml: plain numbers.

    The odometry of a further ride begins at its first pose in the map.
    """
    course = built.course
    first = np.searchsorted(course.ride, course.ride)
    rebased = [course.poses[first] @ inverse(poses[first]) @ poses for poses in (course.wheels, course.lidar)]
    ways = {"wheel_odometry": rebased[0], "lidar_odometry": rebased[1], "map": course.poses}

    def misses(poses: Floats) -> list[tuple[float, float]]:
        found = []
        for loop in course.loops:
            d = difference(inverse(poses[loop.earlier]) @ poses[loop.later], loop.measured)
            found.append((round(math.hypot(d[0], d[1]), 4), round(math.degrees(abs(d[5])), 3)))
        return found

    by = {name: misses(poses) for name, poses in ways.items()}
    last = np.flatnonzero(np.diff(course.ride, append=course.ride[-1] + 1))
    end = {
        f"{name}_end_error_m": round(
            float(np.linalg.norm((poses[last] - course.poses[last])[:, :2, 3], axis=1).max()), 4
        )
        for name, poses in ways.items()
        if name != "map"
    }
    loops = [
        {
            **_times(course, loop),
            "fit": round(loop.share, 3),
            **{f"{name}_m": by[name][k][0] for name in ways},
            **{f"{name}_deg": by[name][k][1] for name in ways},
        }
        for k, loop in enumerate(course.loops)
    ]
    worst = {f"{name}_worst_loop_m": max((miss[0] for miss in by[name]), default=0.0) for name in ways}
    return {"loops_closed": len(loops), **end, **worst, "loops": loops}


def _times(course: Course, loop: Loop) -> dict[str, object]:
    """The loop's ends: ride, if there are several, and time since its begin."""
    found: dict[str, object] = {}
    for end, index in (("from", loop.earlier), ("to", loop.later)):
        ride = int(course.ride[index])
        if course.ride[-1]:
            found[f"{end}_ride"] = ride + 1
        begin_s = course.stamps_s[np.searchsorted(course.ride, ride)]
        found[f"{end}_s"] = round(float(course.stamps_s[index] - begin_s), 1)
    return found

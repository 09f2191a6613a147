"""Converts a frame to points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robot_stack.core.compiled import compiled
from robot_stack.core.point_cloud import SWEEP, Points
from robot_stack.drivers.ouster.frame import Frame
from robot_stack.drivers.ouster.geometry import Geometry

_INTENSITY = 3  # SWEEP in words of four bytes
_TIME = 5
_RING = 8  # and of two


@dataclass(frozen=True, slots=True)
class Limits:
    """Range limits, both included: in the steps of the packets' layout. step_m: of one."""

    least: int
    most: int
    step_m: float


def points_of(frame: Frame, geometry: Geometry, limits: Limits) -> tuple[Points, int]:
    """``SWEEP`` in the order of time, the newest column's at 0 s, and that column's time in ns.

    Column by column, in each from row 0 on. Raises ValueError for a frame without a measured column.
    """
    order = frame.in_order()
    times_ns = frame.times_ns[order]
    if not len(order):
        raise ValueError("no column of the frame was measured")
    newest_ns = int(times_ns[-1])
    seconds = -1e-9 * (np.uint64(newest_ns) - times_ns).astype(np.float64)
    points = np.empty(len(order) * frame.steps.shape[1], SWEEP)
    count = _project(
        frame.steps,
        frame.reflectivity,
        order,
        seconds,
        (geometry.directions, geometry.offsets_m, geometry.columns, geometry.rings),
        (limits.least, limits.most, limits.step_m),
        points.view(np.float32).reshape(len(points), -1),
        points.view(np.uint16).reshape(len(points), -1),
    )
    return points[:count], newest_ns


@compiled(nogil=True)
def _project(  # type: ignore[no-untyped-def]
    steps, reflectivity, order, seconds, geometry, limits, floats, shorts
) -> int:
    """floats, shorts: (n, 6) and (n, 12) views of the points that are written. Returns their number."""
    directions, offsets, columns, rings = geometry
    least, most, step_m = limits
    count = 0
    for i in range(len(order)):
        column = order[i]
        turn = columns[column]
        for beam in range(steps.shape[1]):
            seen = steps[column, beam]
            if seen == 0 or seen < least or seen > most:
                continue
            far = step_m * seen
            x = directions[beam, 0] * far + offsets[beam, 0]
            y = directions[beam, 1] * far + offsets[beam, 1]
            z = directions[beam, 2] * far + offsets[beam, 2]
            floats[count, 0] = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z
            floats[count, 1] = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z
            floats[count, 2] = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z
            floats[count, _INTENSITY] = reflectivity[column, beam]
            floats[count, _TIME] = seconds[i]
            shorts[count, _RING] = rings[beam]
            shorts[count, _RING + 1] = 0
            count += 1
    return count

"""Where a safety edge senses an object: the part of the outline on which a strip is the first thing that it touches."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.robot import Footprint, Robot
from robot_stack.core.robot_shape import Placed, Solid
from robot_stack.coverage.rays import PackedSolids

F64 = NDArray[np.float64]
_OUTSIDE_M = 0.05  # where an object starts: rays ignore the faces that they begin on
_LEVEL_M = 0.02
_TINY = 1e-9


def strips_of(robot: Robot) -> list[Placed]:
    """The strips of the safety edge as two crossed boxes in base_link, see ``Robot.edge_boxes``."""
    chassis = robot.chassis
    middle_m, height_m = 0.5 * (chassis.bottom_m + chassis.top_m), chassis.top_m - chassis.bottom_m
    found = []
    for front_m, rear_m, half_m in robot.edge_boxes():
        solid = Solid(
            kind="box",
            size_m=(front_m - rear_m, 2.0 * half_m, height_m),
            at_m=(0.5 * (front_m + rear_m), 0.0, middle_m),
            turn_deg=(0.0, 0.0, 0.0),
            colour="#000000",
        )
        found.append(Placed("safety_edge", solid, solid.pose()))
    return found


def sensed(
    strips: Sequence[Placed],
    solids: Sequence[Placed],
    footprint: Footprint,
    width_m: float,
    top_m: float,
    step_m: float,
) -> NDArray[np.bool_]:
    """(k,) per point of the footprint's outline, every ``step_m``: an upright cylinder that comes straight in there
    touches a strip before any of the solids. The cylinder stands on the ground; corners are met along both sides."""
    points, inwards = _outline(footprint, step_m)
    if not strips:
        return np.zeros(len(points), np.bool_)
    radius_m = 0.5 * width_m
    aside_m = np.linspace(-0.98 * radius_m, 0.98 * radius_m, 9)
    behind_m = radius_m - np.sqrt(radius_m**2 - aside_m**2)  # of the cylinder's face
    levels_m = np.arange(0.5 * _LEVEL_M, top_m, _LEVEL_M)
    edge, body = PackedSolids(strips), PackedSolids(solids)
    found = np.zeros(len(points), np.bool_)
    for i, (point, inward) in enumerate(zip(points, inwards, strict=True)):
        beam, along = np.array([[*inward, 0.0]]), np.array([-inward[1], inward[0]])
        strip_m = solid_m = math.inf
        for aside, behind in zip(aside_m, behind_m, strict=True):
            x, y = point + aside * along - (behind + _OUTSIDE_M) * inward
            for z in levels_m:
                origin = np.array([x, y, z])
                strip_m = min(strip_m, float(edge.ranges(origin, beam)[0]) - behind)
                solid_m = min(solid_m, float(body.ranges(origin, beam)[0]) - behind)
        found[i] = strip_m <= solid_m + _TINY and math.isfinite(strip_m)
    return found


def _outline(footprint: Footprint, step_m: float) -> tuple[F64, F64]:
    """(k, 2) points in the middle of equal steps along the four sides, and (k, 2) their inward unit normals."""
    front, rear, half = footprint.front_m, footprint.rear_m, 0.5 * footprint.width_m
    corners = np.array([(front, -half), (front, half), (rear, half), (rear, -half)])
    points, normals = [], []
    for begin, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length_m = float(np.hypot(*(end - begin)))
        count = max(1, round(length_m / step_m))
        along = (end - begin) / length_m
        points.append(begin + (np.arange(count) + 0.5)[:, None] * (length_m / count) * along)
        normals.append(np.tile((-along[1], along[0]), (count, 1)))
    return np.concatenate(points), np.concatenate(normals)

"""The compiled ray caster: every beam of a spinning sensor against ground, boxes and cylinders.

A beam is identified by column and ring. Each solid is tested only by the beams within its angles at the sensor,
computed for every block of columns, because sensor and movers move while the sensor turns. Exact within a block except
for movers, which are fixed for the 1.5 ms of a block.
"""

from __future__ import annotations

import math

import numpy as np

from robot_stack.core.compiled import compiled
from sim.lidar.rays import Angles, meet_window, safe
from sim.lidar.shapes import F64, I64, Beams, Met, Solids
from sim.lidar.windows import window_of

BLOCK = 37  # columns
GROUND_HIT, WET_HIT, PIT_HIT, MIRROR_HIT, AIRBORNE_HIT, FIRST_SOLID = 0, 1, 2, 3, 4, 5
NO_HIT = -1
_TINY = 1e-12


@compiled(error_model="numpy")
def cast_ground(beams: Beams, rects: F64, met: Met) -> None:
    """Intersects every beam with the ground, wet ground and pits; overwrites ``met``.

    rects: (k, 7) centre x, y, cos and sin of yaw, half length, half width, depth: wet ground (depth 0) or a pit.
    """
    angles = _angles(beams)
    columns = len(beams.azimuths)
    shape = np.empty((3, 3))
    place = np.empty(3)
    window = np.empty(4, np.int64)
    for block in range((columns + BLOCK - 1) // BLOCK):
        first, last = block * BLOCK, min(columns, (block + 1) * BLOCK)
        _ground(first, last, beams, angles, met)
        for k in range(len(rects)):
            place[0], place[1], place[2] = rects[k, 0], rects[k, 1], 0.0
            shape[:] = 0.0
            shape[0, 0] = shape[1, 1] = rects[k, 2]
            shape[1, 0], shape[0, 1], shape[2, 2] = rects[k, 3], -rects[k, 3], 1.0
            flat = np.array([rects[k, 4], rects[k, 5], 1e-6])
            if window_of(first, last, beams, place, shape, flat, window):
                _rect(window, beams, angles, rects[k], met)


@compiled(error_model="numpy")
def cast_solids(beams: Beams, begin: int, end: int, solids: Solids, met: Met) -> None:
    """Merges the solids begin to end - 1 where they are nearer than the results so far."""
    angles = _angles(beams)
    columns = len(beams.azimuths)
    shape = np.empty((3, 3))
    place = np.empty(3)
    window = np.empty(4, np.int64)
    for block in range((columns + BLOCK - 1) // BLOCK):
        first, last = block * BLOCK, min(columns, (block + 1) * BLOCK)
        for i in range(begin, end):
            place_of(solids, i, block, place, shape)
            half = solids.half[i]
            if window_of(first, last, beams, place, shape, half, window):
                meet_window(window, solids.kind[i], FIRST_SOLID + i, beams, angles, place, shape, half, met)


@compiled(error_model="numpy")
def _angles(beams: Beams) -> Angles:
    return np.cos(beams.azimuths), np.sin(beams.azimuths), np.cos(beams.elevations), np.sin(beams.elevations)


@compiled(error_model="numpy")
def _ground(first: int, last: int, beams: Beams, angles: Angles, met: Met) -> None:
    _, _, origins, rotations, max_m = beams
    column_cos, column_sin, ring_cos, ring_sin = angles
    ranges, hits, cosines = met
    for c in range(first, last):
        level = rotations[c, 2, 0] * column_cos[c] + rotations[c, 2, 1] * column_sin[c]
        up, height = rotations[c, 2, 2], origins[c, 2]
        for r in range(len(ring_cos)):
            fall = -(ring_cos[r] * level + ring_sin[r] * up)
            far = height / fall if fall > _TINY else np.inf
            reached = far <= max_m
            ranges[c, r] = far if reached else np.inf
            hits[c, r] = GROUND_HIT if reached else NO_HIT
            cosines[c, r] = fall


@compiled(error_model="numpy")
def place_of(solids: Solids, number: int, block: int, place: F64, shape: F64) -> None:
    """Pose in map of a solid, which stands or which a mover carries, in a block of columns."""
    mover, centre, turned = solids.mover[number], solids.centre[number], solids.turned[number]
    if mover < 0:
        place[:], shape[:] = centre, turned
        return
    position, rotation = solids.mover_position[block, mover], solids.mover_rotation[block, mover]
    for i in range(3):
        place[i] = position[i]
        for j in range(3):
            place[i] += rotation[i, j] * centre[j]
            shape[i, j] = 0.0
            for k in range(3):
                shape[i, j] += rotation[i, k] * turned[k, j]


@compiled(error_model="numpy")
def _rect(window: I64, beams: Beams, angles: Angles, rect: F64, met: Met) -> None:
    """Handles beams that hit the ground inside a rectangle: wet ground, or a pit that they enter."""
    _, _, origins, rotations, max_m = beams
    column_cos, column_sin, ring_cos, ring_sin = angles
    ranges, hits, cosines = met
    cx, cy, cos_y, sin_y, half_x, half_y, depth = rect[0], rect[1], rect[2], rect[3], rect[4], rect[5], rect[6]
    for c in range(window[0], window[1]):
        away_x, away_y = origins[c, 0] - cx, origins[c, 1] - cy
        ox, oy = cos_y * away_x + sin_y * away_y, cos_y * away_y - sin_y * away_x
        ux = rotations[c, 0, 0] * column_cos[c] + rotations[c, 0, 1] * column_sin[c]
        uy = rotations[c, 1, 0] * column_cos[c] + rotations[c, 1, 1] * column_sin[c]
        for r in range(window[2], window[3]):
            if hits[c, r] != GROUND_HIT:
                continue
            mx = ring_cos[r] * ux + ring_sin[r] * rotations[c, 0, 2]
            my = ring_cos[r] * uy + ring_sin[r] * rotations[c, 1, 2]
            dx, dy = safe(cos_y * mx + sin_y * my), safe(cos_y * my - sin_y * mx)
            far, fall = ranges[c, r], cosines[c, r]
            if abs(ox + far * dx) > half_x or abs(oy + far * dy) > half_y:
                continue
            if depth <= 0.0:
                hits[c, r] = WET_HIT
                continue
            side_x = (math.copysign(half_x, dx) - ox) / dx
            side_y = (math.copysign(half_y, dy) - oy) / dy
            floor = (origins[c, 2] + depth) / fall
            far = min(side_x, side_y, floor)
            cosine = fall if far == floor else abs(dx) if far == side_x else abs(dy)
            reached = far <= max_m
            ranges[c, r] = far if reached else np.inf
            hits[c, r] = PIT_HIT if reached else NO_HIT
            cosines[c, r] = cosine

"""Wet ground as a mirror: some beams that meet it go on, and what they find is reported below the ground."""

from __future__ import annotations

import numpy as np

from robot_stack.core.compiled import compiled
from sim.lidar.kernels import BLOCK, MIRROR_HIT, NO_HIT, WET_HIT, carried
from sim.lidar.rays import enter
from sim.lidar.shapes import F32, F64, I16, I64


@compiled(error_model="numpy")
def mirror(
    azimuths: F64,
    elevations: F64,
    origins: F64,
    rotations: F64,
    max_m: float,
    share: float,
    uniforms: F32,
    kind: I64,
    mover: I64,
    centre: F64,
    turned: F64,
    half: F64,
    mover_position: F64,
    mover_rotation: F64,
    ranges: F32,
    hits: I16,
    cosines: F32,
) -> None:
    """Changes ``share`` of the wet hits of ``kernels.cast``, which the other arguments are as given to and filled by.

    uniforms: at least c r. A mirrored beam's range is the whole way; one that finds nothing is lost.
    """
    shape, place, origin, beam = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    ring_cos, ring_sin = np.cos(elevations), np.sin(elevations)
    for c in range(len(azimuths)):
        for r in range(len(elevations)):
            if hits[c, r] != WET_HIT or uniforms[c * len(elevations) + r] >= share:
                continue
            ahead, aside = ring_cos[r] * np.cos(azimuths[c]), ring_cos[r] * np.sin(azimuths[c])
            down = ranges[c, r]
            for i in range(3):
                beam[i] = rotations[c, i, 0] * ahead + rotations[c, i, 1] * aside + rotations[c, i, 2] * ring_sin[r]
                origin[i] = origins[c, i] + down * beam[i]
            beam[2], origin[2] = -beam[2], 0.0
            nearest, cosine = np.inf, 0.0
            for k in range(len(kind)):
                if mover[k] < 0:
                    place[:], shape[:] = centre[k], turned[k]
                else:
                    block = c // BLOCK
                    at, facing = mover_position[block, mover[k]], mover_rotation[block, mover[k]]
                    carried(centre[k], turned[k], at, facing, place, shape)
                far, slant = enter(kind[k], origin, beam, place, shape, half[k])
                if far < nearest:
                    nearest, cosine = far, slant
            met = down + nearest <= max_m
            ranges[c, r] = down + nearest if met else np.inf
            hits[c, r] = MIRROR_HIT if met else NO_HIT
            cosines[c, r] = cosine

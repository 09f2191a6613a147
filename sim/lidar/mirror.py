"""Wet ground as a mirror: some beams that meet it go on, and what they find is reported below the ground."""

from __future__ import annotations

import numpy as np

from robot_stack.core.compiled import compiled
from sim.lidar.kernels import BLOCK, MIRROR_HIT, NO_HIT, WET_HIT, place_of
from sim.lidar.rays import enter
from sim.lidar.shapes import F32, Beams, Met, Solids


@compiled(error_model="numpy")
def mirror(beams: Beams, share: float, uniforms: F32, solids: Solids, met: Met) -> None:
    """Changes ``share`` of the wet hits in ``met``.

    uniforms: at least c r. A mirrored beam's range is the whole way; one that finds nothing is lost.
    """
    azimuths, elevations, origins, rotations, max_m = beams
    ranges, hits, cosines = met
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
            for k in range(len(solids.kind)):
                place_of(solids, k, c // BLOCK, place, shape)
                far, slant = enter(solids.kind[k], origin, beam, place, shape, solids.half[k])
                if far < nearest:
                    nearest, cosine = far, slant
            found = down + nearest <= max_m
            ranges[c, r] = down + nearest if found else np.inf
            hits[c, r] = MIRROR_HIT if found else NO_HIT
            cosines[c, r] = cosine

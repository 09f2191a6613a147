"""Panes of glass before the simulated LiDAR: it reports the pane, what is behind it, or what is mirrored in it.

A pane splits the light after Fresnel, both its surfaces taken together and unpolarised: at right angles 8 % are thrown
back as by a mirror and 92 % go through, at 80 deg more than half is mirrored. What is behind is lit and seen through
the pane, so its return is dimmed twice, and so is a mirror image, which stands as far behind the pane as the thing is
before it. The pane itself returns a little from the dirt on it, and all of its mirrored light where the beam meets it
at right angles, within ``glint_deg``: that laser scanners see glass itself only about its normal, and otherwise what is
behind it or a mirror image of what is before it, is what work on mapping with glass reports (Koch et al. 2015 with
several echoes of a beam, Zhao et al. 2020 with a spinning LiDAR).

The sensor reports the strongest. Each return fluctuates from beam to beam as laser light from rough surfaces does, with
exponential intensity (speckle, Goodman), so that of a bright and a dim one the dim one wins at times. Dirt and the
width of the glint are chosen. One pane counts: beams that have met one pass all others as if they were not there.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from sim.lidar.kernels import BLOCK, FIRST_SOLID, GROUND_HIT, MIRROR_HIT, place_of
from sim.lidar.rays import enter
from sim.lidar.shapes import F32, F64, I64, Beams, Met, Solids

_TINY = 1e-9


@compiled(error_model="numpy")
def mirrored_share(cosine: float, index: float) -> float:
    """Of unpolarised light that meets a pane of that refractive index at an angle of that cosine to its normal."""
    inside = math.sqrt(1.0 - (1.0 - cosine * cosine) / (index * index))
    upright = (cosine - index * inside) / (cosine + index * inside)
    along = (inside - index * cosine) / (inside + index * cosine)
    once = 0.5 * (upright * upright + along * along)
    return 2.0 * once / (1.0 + once)  # of both surfaces, to and fro between them


@compiled(error_model="numpy")
def look_through(
    chosen: I64,
    uniforms: F64,
    beams: Beams,
    panes: NDArray[np.bool_],
    index: float,
    glint_cosine: float,
    reflectivity_of: F32,
    solids: Solids,
    met: Met,
) -> None:
    """Changes the beams in ``met`` that met a pane.

    chosen: (k,) numbers of those beams, column by column; uniforms: (k, 3). panes: (n,) which solids are; upright boxes
    of the map. The range of what is mirrored is the whole way.
    """
    azimuths, elevations, origins, rotations, max_m = beams
    ranges, hits, cosines = met
    rings = len(elevations)
    at, beam, back = np.empty(3), np.empty(3), np.empty(3)
    for j in range(len(chosen)):
        c, r = chosen[j] // rings, chosen[j] % rings
        pane = hits[c, r] - FIRST_SOLID
        ring_cos = math.cos(elevations[r])
        ahead, aside, up = ring_cos * math.cos(azimuths[c]), ring_cos * math.sin(azimuths[c]), math.sin(elevations[r])
        way = ranges[c, r]
        for i in range(3):
            beam[i] = rotations[c, i, 0] * ahead + rotations[c, i, 1] * aside + rotations[c, i, 2] * up
            at[i] = origins[c, i] + way * beam[i]
        _reflect(beam, at, solids.centre[pane], solids.turned[pane], solids.half[pane], back)
        cosine = min(max(float(cosines[c, r]), _TINY), 1.0)
        share = mirrored_share(cosine, index)
        own = reflectivity_of[hits[c, r]]
        shine = 1.0 if cosine >= glint_cosine else own * cosine
        best = -math.log(1.0 - uniforms[j, 0]) * shine / (way * way)
        own_cosine = shine / own
        ranges[c, r], cosines[c, r] = way, own_cosine
        for turn in range(2):
            ray, passed = (beam, 1.0 - share) if turn == 0 else (back, share)
            far, slant, behind = _meet(c // BLOCK, at, ray, panes, solids)
            total = way + far
            if total > max_m:
                continue
            light = reflectivity_of[behind] * slant * passed * passed
            strength = -math.log(1.0 - uniforms[j, 1 + turn]) * light / (total * total)
            if strength <= best:
                continue
            best = strength
            ranges[c, r], hits[c, r] = total, behind if turn == 0 else MIRROR_HIT
            cosines[c, r] = light / reflectivity_of[hits[c, r]]


@compiled(error_model="numpy")
def _reflect(beam: F64, at: F64, centre: F64, turned: F64, half: F64, back: F64) -> None:
    """back: where the beam goes on from the side of the box that it met."""
    side, most = 0, -1.0
    for axis in range(3):
        off = 0.0
        for i in range(3):
            off += turned[i, axis] * (at[i] - centre[i])
        if abs(off) / half[axis] > most:
            side, most = axis, abs(off) / half[axis]
    along = 0.0
    for i in range(3):
        along += beam[i] * turned[i, side]
    for i in range(3):
        back[i] = beam[i] - 2.0 * along * turned[i, side]


@compiled(error_model="numpy")
def _meet(block: int, at: F64, ray: F64, panes: NDArray[np.bool_], solids: Solids) -> tuple[float, float, int]:
    """How far, at what cosine and what a ray meets that is no pane; the ground is level and dry there."""
    shape, place = np.empty((3, 3)), np.empty(3)
    nearest, slant, met = np.inf, 0.0, GROUND_HIT
    if ray[2] < -_TINY:
        nearest, slant = at[2] / -ray[2], -ray[2]
    for k in range(len(solids.kind)):
        if panes[k]:
            continue
        place_of(solids, k, block, place, shape)
        far, cosine = enter(solids.kind[k], at, ray, place, shape, solids.half[k])
        if far < nearest:
            nearest, slant, met = far, cosine, FIRST_SOLID + k
    return nearest, slant, met

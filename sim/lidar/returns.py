"""The compiled sensor model: from each beam's hit to the sensor's measurement."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from sim.lidar.kernels import AIRBORNE_HIT, NO_HIT
from sim.lidar.labels import NEAR
from sim.lidar.shapes import F32, F64, Met

U32 = NDArray[np.uint32]
U8 = NDArray[np.uint8]

# Order of the numbers in ``model``.
MIN_M, MAX_M, NOISE_M, TEN_PERCENT_M, LOST, MIXED, MIXED_STEP_M, INTENSITY_NOISE, WET_LOST = range(9)
COVERED, COVER_RETURN, COVER_NEAREST_M, COVER_FARTHEST_M, MIXED_REACH_M, EXTINCTION_PER_M = range(9, 15)
MODEL_SIZE = 15
_FULL_SCALE = 255.0
_COVER_INTENSITY = 5.0


@compiled(error_model="numpy", inline="always")
def _write(row: int, far: float, cos_a: float, sin_a: float, cos_e: float, sin_e: float, words: F32) -> None:
    flat = far * cos_e
    words[row, 0], words[row, 1], words[row, 2] = flat * cos_a, flat * sin_a, far * sin_e


@compiled(error_model="numpy")
def returns(
    azimuths: F64,
    elevations: F64,
    biases_m: F64,
    times_s: F64,
    met: Met,
    label_of: U8,
    reflectivity_of: F32,
    wet_hit: int,
    model: F64,
    normals: F32,
    uniforms: F32,
    words: F32,
    integers: U32,
    labels: U8,
) -> int:
    """Writes the points in the order of firing, ring by ring; returns their number.

    elevations: (r,) nominal. biases_m: (r,) systematic excess of the reported ranges.

    normals, uniforms: at least 3 c r each. words, integers: the
    same memory, (c r, 6): x y z intensity ring time. labels: (c r,).
    """
    ranges, hits, cosines = met
    count, draw = 0, 0
    ring_cos, ring_sin = np.cos(elevations), np.sin(elevations)
    gain = model[TEN_PERCENT_M] ** 2 / 0.1
    for c in range(len(azimuths)):
        cos_a, sin_a, time_s = math.cos(azimuths[c]), math.sin(azimuths[c]), np.float32(times_s[c])
        # What covers the lens spreads from the front.
        covered = model[COVERED] > 0.0 and math.acos(min(1.0, max(-1.0, cos_a))) <= math.pi * model[COVERED]
        for r in range(len(elevations)):
            draw += 3
            far, hit = ranges[c, r], hits[c, r]
            if covered:
                if uniforms[draw] >= model[COVER_RETURN]:
                    continue
                near, span = model[COVER_NEAREST_M], model[COVER_FARTHEST_M] - model[COVER_NEAREST_M]
                _write(count, near + span * uniforms[draw + 1], cos_a, sin_a, ring_cos[r], ring_sin[r], words)
                words[count, 3], words[count, 5] = _COVER_INTENSITY, time_s
                integers[count, 4], labels[count] = r, NEAR
                count += 1
                continue
            if hit == NO_HIT:
                continue
            light = reflectivity_of[hit] * cosines[c, r]
            if model[EXTINCTION_PER_M] > 0.0:
                light *= math.exp(-2.0 * model[EXTINCTION_PER_M] * far)
            signal = light * gain / (far * far)
            # Half of the returns are there at signal 1, nearly all at 3, nearly none at 1/3.
            if uniforms[draw] * (1.0 + signal * signal) > signal * signal or uniforms[draw + 1] < model[LOST]:
                continue
            if hit == wet_hit and uniforms[draw + 2] < model[WET_LOST]:
                continue
            if c > 0 and hits[c - 1, r] != NO_HIT:
                step = ranges[c - 1, r] - far
                small = hit == AIRBORNE_HIT or hits[c - 1, r] == AIRBORNE_HIT  # it fills no beam
                if (
                    model[MIXED_STEP_M] < abs(step) < model[MIXED_REACH_M]
                    and uniforms[draw + 2] < model[MIXED]
                    and hits[c - 1, r] != hit
                    and not small
                ):
                    far += step * uniforms[draw + 1]
            far += biases_m[r] + model[NOISE_M] * normals[draw]
            if far < model[MIN_M] or far > model[MAX_M]:
                continue
            _write(count, far, cos_a, sin_a, ring_cos[r], ring_sin[r], words)
            words[count, 3] = min(
                _FULL_SCALE, max(0.0, _FULL_SCALE * light + model[INTENSITY_NOISE] * normals[draw + 1])
            )
            integers[count, 4] = r
            words[count, 5] = time_s
            labels[count] = label_of[hit]
            count += 1
    return count

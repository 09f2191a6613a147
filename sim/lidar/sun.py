"""The sun in the simulated LiDAR's view: false returns at any range, and lost true ones.

A receiver directed near the sun receives its light all the time: counts occur at random, evenly in time, so the range
of the first one is exponentially distributed, and the pulse's returns from behind it are not reported. The same
light raises the threshold that a true return must pass, so a share of them is lost. Both are greatest towards the disc
and fall off linearly to nothing at ``reach_deg``: stray light in the optics, the sensor's own field is far narrower.

That direct sun does both to automotive LiDARs is published (TU Darmstadt, Institute of Automotive Engineering, 2022:
months of recorded fog, rain, snow and sunlight); how much depends on the device, and the numbers in the configuration
are chosen, not measured. No house or person occludes the sun, which is the worse case.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim.lidar.kernels import AIRBORNE_HIT, NO_HIT
from sim.lidar.params import Glare
from sim.lidar.shapes import F32, F64, Met


@dataclass(frozen=True, slots=True)
class Sun:
    """Direction of the sun, in map, and a factor of the false returns. A low sun, at the height of people, is worst."""

    azimuth_deg: float
    elevation_deg: float = 5.0
    returns_factor: float = 1.0

    def direction(self) -> F64:
        """(3,) towards it, map."""
        azimuth, elevation = math.radians(self.azimuth_deg), math.radians(self.elevation_deg)
        flat = math.cos(elevation)
        return np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)])


def towards(sun: Sun, glare: Glare, azimuths: F64, elevations: F64, rotations: F64) -> F32:
    """(c, r) share of the glare that each beam receives, 0 to 1. rotations: (c, 3, 3) of the sensor in map."""
    x, y, z = (rotations.transpose(0, 2, 1) @ sun.direction()).T
    level = x * np.cos(azimuths) + y * np.sin(azimuths)
    cosine = np.outer(level, np.cos(elevations)) + np.outer(z, np.sin(elevations))
    away_deg = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    share: F32 = np.clip(1.0 - away_deg / glare.reach_deg, 0.0, 1.0).astype(np.float32)
    return share


def dazzle(
    share: F32,
    sun: Sun,
    glare: Glare,
    bright_at_1m: float,
    max_m: float,
    random: np.random.Generator,
    met: Met,
) -> None:
    """Changes what beams near the sun meet.

    bright_at_1m: what a return from 1 m must throw back for the sensor to report it for sure; a count is reported, so
    it is as bright as that.
    """
    ranges, hits, cosines = met
    into = np.flatnonzero(share > 0.0)
    strength = share.ravel()[into].astype(np.float64)
    uniforms = random.random((2, len(into)))
    rate_per_m = np.maximum(glare.false_per_m * sun.returns_factor * strength, 1e-12)
    count_m = -np.log1p(-uniforms[0]) / rate_per_m
    met_m = ranges.reshape(-1)[into]
    lost = uniforms[1] < glare.lost_share * strength
    false = (count_m < max_m) & (lost | (count_m < met_m))
    gone = into[lost & ~false]
    ranges.reshape(-1)[gone], hits.reshape(-1)[gone] = np.inf, NO_HIT
    mine, far_m = into[false], count_m[false]
    ranges.reshape(-1)[mine], hits.reshape(-1)[mine] = far_m, AIRBORNE_HIT
    cosines.reshape(-1)[mine] = np.minimum(bright_at_1m * far_m**2, 1.0)

"""Rain, snow and dust before the simulated LiDAR: returns from airborne particles, and extinction.

Numbers of drops and flakes fall off with their size, N(D) = N0 exp(-L D): of rain after Marshall and Palmer (1948)
N0 = 8000 / (m3 mm) and L = 4.1 R^-0.21 / mm, of snow after Gunn and Marshall (1958) N0 = 3800 R^-0.87 and
L = 2.55 R^-0.48 by the melted diameter; R: mm/h of water. As in LISA (Kilic et al. 2021) and in the snowfall of Hahner
et al. (2022) a beam is a cone, a particle in it reflects its share of the beam's cross-section, and the sensor
reports whichever is stronger, particle or surface. The share needed for a return grows with the square of the range, so
returns come from near. Extinction is what the same particles occlude, pi N0 / L^3 of the area, both ways, after Beer
and Lambert: a true target is seen less far, as in Goodin et al. (2019). Wet surfaces are darker.

How many of the particles in a beam a real sensor reports (``seen_share``) is chosen, not measured: it depends on the
device's overlap, pulse and filters. Dust: an even haze of a given visibility (Koschmieder, 5 % contrast) in which beams
return by chance; a dense plume, whose returns hang together, is not modelled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from sim.lidar.kernels import AIRBORNE_HIT, NO_HIT
from sim.lidar.params import Air, LidarParams
from sim.lidar.shapes import F32, F64, Met

Kind = Literal["rain", "snow", "dust"]
RAIN, SNOW, DUST = "rain", "snow", "dust"
_STEP_M, _REACH_M = 0.05, 40.0
_KOSCHMIEDER = -math.log(0.05)
_RAIN_N0, _RAIN_L, _RAIN_POWER = 8000.0, 4.1, -0.21
_SNOW_N0, _SNOW_N0_POWER, _SNOW_L, _SNOW_POWER = 3800.0, -0.87, 2.55, -0.48


@dataclass(frozen=True, slots=True)
class Weather:
    """kind; amount: rain and snow mm/h of water, dust visibility in m. returns_factor: multiplies the returns."""

    kind: Kind
    amount: float
    returns_factor: float = 1.0


class Particles(NamedTuple):
    """Effects of a kind of weather on a sensor.

    ranges_m, below: (k,) mean returns of one beam from nearer than each range. least, mean: (k,) of a particle that is
    seen there: the least square root of the share of the light that it throws back, and what is added to it on average.
    extinction_per_m: one way. surface_factor, ground_factor: of their reflectivity.
    """

    ranges_m: F64
    below: F64
    least: F64
    mean: F64
    extinction_per_m: float
    surface_factor: float = 1.0
    ground_factor: float = 1.0


def particles(weather: Weather, params: LidarParams) -> Particles:
    """The particles of the weather for this sensor."""
    air, far = params.air, np.arange(params.ranging.min_m, _REACH_M, _STEP_M)
    dimmest = air.least_signal * far**2 * 0.1 / params.ranging.range_at_ten_percent_m**2  # share that is noticed
    if weather.kind == DUST:
        return _dust(weather, air, far, dimmest)
    r = weather.amount
    if weather.kind == RAIN:
        n0, slope, light = _RAIN_N0, _RAIN_L * r**_RAIN_POWER, air.rain_reflectivity
    else:
        light = air.snow_reflectivity
        n0 = _SNOW_N0 * r**_SNOW_N0_POWER / air.flake_size_factor
        slope = _SNOW_L * r**_SNOW_POWER / air.flake_size_factor
    beam_mm = air.beam_width_mm + air.beam_divergence_mrad * far
    smallest_mm = beam_mm * np.sqrt(dimmest / light)
    per_m3 = n0 / slope * np.exp(-slope * smallest_mm)
    per_m = air.seen_share * per_m3 * 0.25 * math.pi * (1e-3 * beam_mm) ** 2 * (smallest_mm < beam_mm)
    mean = math.sqrt(light) / (slope * beam_mm)
    extinction = math.pi * n0 / slope**3 * 1e-6
    below = weather.returns_factor * np.cumsum(per_m) * _STEP_M
    dark = (air.wet_surface_factor, air.wet_ground_factor) if weather.kind == RAIN else (1.0, 1.0)
    return Particles(far, below, np.sqrt(dimmest), mean, extinction, *dark)


def _dust(weather: Weather, air: Air, far: F64, dimmest: F64) -> Particles:
    extinction = _KOSCHMIEDER / weather.amount
    # What a length of haze as long as the pulse throws back, as a surface that would do the same.
    share = math.pi * extinction * air.pulse_m / air.dust_lidar_ratio_sr * np.exp(-2.0 * extinction * far)
    strength = share / dimmest
    per_m = air.dust_share_per_m * strength**2 / (1.0 + strength**2)
    below = weather.returns_factor * np.cumsum(per_m) * _STEP_M
    return Particles(far, below, np.sqrt(share), np.zeros_like(far), extinction)


def draw(air: Particles, beams: int, random: np.random.Generator) -> tuple[NDArray[np.int64], F64]:
    """(n,) True for beams that hit a detectable particle, and (n, 2) uniform numbers for ``meet``."""
    count = int(random.poisson(air.below[-1] * beams))
    return random.integers(0, beams, count), random.random((count, 2))


@compiled(error_model="numpy")
def meet(
    chosen: NDArray[np.int64],
    uniforms: F64,
    air: Particles,
    reflectivity_of: F32,
    result: Met,
) -> None:
    """Puts particles into the chosen beams where they are brighter than the surface behind them.

    reflectivity_of: by number of what a beam met. A particle's share of the light stands in cosines.
    """
    ranges, hits, cosines = result
    below, rings = air.below, ranges.shape[1]
    for i in range(len(chosen)):
        c, r = chosen[i] // rings, chosen[i] % rings
        k = min(np.searchsorted(below, uniforms[i, 0] * below[-1]), len(below) - 1)
        far = air.ranges_m[k]
        if far >= ranges[c, r]:
            continue
        root = air.least[k] - air.mean[k] * math.log(1.0 - uniforms[i, 1])
        share = min(root * root, 1.0)
        if hits[c, r] != NO_HIT:
            way, met = ranges[c, r], hits[c, r]
            light = cosines[c, r] * (1.0 if met == AIRBORNE_HIT else reflectivity_of[met])
            if share / (far * far) <= light * math.exp(-2.0 * air.extinction_per_m * (way - far)) / (way * way):
                continue
        ranges[c, r], hits[c, r], cosines[c, r] = far, AIRBORNE_HIT, share

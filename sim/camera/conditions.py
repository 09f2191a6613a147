"""Light, weather and damage: all disturbances of a picture, as values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Shadow:
    """The edge of a shadow across the boards, in the board's plane (right and up from the middle of the panel).

    offset_m: of the edge from the middle, along the edge's normal; angle_rad: of that normal, 0 right, pi/2 up; the
    area beyond the edge is in shadow. softness_m: width of the transition (0: hard). depth: share of light lost.
    """

    offset_m: float = 0.0
    angle_rad: float = 0.6
    softness_m: float = 0.0
    depth: float = 0.7


@dataclass(frozen=True, slots=True)
class Glare:
    """The sun in the lens: a bloom around a place in the image, and a veil over all of it.

    column_px, row_px: middle; radius_px: of the saturated part; veil_dn: grey levels added everywhere.
    """

    column_px: float
    row_px: float
    radius_px: float
    veil_dn: float = 25.0


@dataclass(frozen=True, slots=True)
class Conditions:
    """One picture's conditions; the default is clear daylight.

    illumination: of full daylight. gradient_per_m: relative change of the light along the board, right and up.
    rain: share 0..1 of a lens full of drops. blur_px: extra standard deviation (fogged or out of focus).
    noise_factor: of the sensor's own noise. dirt: share 0..1 of a marker that is dirty, by id. covered: marker ids.
    """

    illumination: float = 1.0
    gradient_per_m: tuple[float, float] = (0.0, 0.0)
    shadow: Shadow | None = None
    glare: Glare | None = None
    rain: float = 0.0
    blur_px: float = 0.0
    noise_factor: float = 1.0
    dirt: Mapping[int, float] = field(default_factory=dict)
    covered: frozenset[int] = frozenset()

    def __post_init__(self) -> None:
        _check("illumination", self.illumination, 0.0, 10.0)
        for value in self.gradient_per_m:
            _check("gradient_per_m", value, -2.0, 2.0)
        _check("rain", self.rain, 0.0, 1.0)
        _check("blur_px", self.blur_px, 0.0, 30.0)
        _check("noise_factor", self.noise_factor, 0.0, 100.0)
        for marker, share in self.dirt.items():
            _check(f"dirt of marker {marker}", share, 0.0, 1.0)
        if self.shadow is not None:
            _check("shadow.depth", self.shadow.depth, 0.0, 1.0)
            _check("shadow.softness_m", self.shadow.softness_m, 0.0, 10.0)
            _check("shadow.offset_m", self.shadow.offset_m, -10.0, 10.0)
            _check("shadow.angle_rad", self.shadow.angle_rad, -10.0, 10.0)
        if self.glare is not None:
            _check("glare.radius_px", self.glare.radius_px, 0.0, 5000.0)
            _check("glare.veil_dn", self.glare.veil_dn, 0.0, 255.0)
            _check("glare.column_px", self.glare.column_px, -1e5, 1e5)
            _check("glare.row_px", self.glare.row_px, -1e5, 1e5)


def _check(name: str, value: float, low: float, high: float) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        raise ValueError(f"{name} must be in {low:g}..{high:g}, is {value}")


CLEAR = Conditions()

"""A sensor that measures ranges along beams: its mounting, field of view, range and rate."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from robot_stack.core.config import Config, Positive

Angle = Annotated[float, Field(ge=-180.0, le=180.0)]
Xyz = Annotated[tuple[float, float, float], Field(description="m, base_link")]
F64 = NDArray[np.float64]


class RangeSensor(Config):
    """Columns of rings, evenly spaced. Sensor frame: x to azimuth 0, z its axis; columns go clockwise about z.

    rpy_deg: turned about base_link's fixed axes x, y, z. first_azimuth_deg: of the first column; span_deg: from there.
    range_bias_m, elevation_bias_deg: largest constant error of a ring's ranges and of its elevation: the residual of
    calibration, which a mean over many points does not remove.
    """

    device: str
    xyz_m: Xyz
    rpy_deg: tuple[Angle, Angle, Angle]
    rings: Annotated[int, Field(ge=1, le=512)]
    columns: Annotated[int, Field(ge=2, le=8192)]
    lowest_deg: Annotated[float, Field(ge=-90.0, le=90.0)]
    highest_deg: Annotated[float, Field(ge=-90.0, le=90.0)]
    first_azimuth_deg: Angle
    span_deg: Annotated[float, Field(gt=0.0, le=360.0)]
    period_s: Positive
    min_m: Positive
    max_m: Positive
    noise_m: Annotated[float, Field(ge=0.0)]
    range_bias_m: Annotated[float, Field(ge=0.0, le=0.2)]
    elevation_bias_deg: Annotated[float, Field(ge=0.0, le=1.0)]

    @model_validator(mode="after")
    def _makes_sense(self) -> RangeSensor:
        if self.highest_deg < self.lowest_deg or (self.rings > 1) != (self.highest_deg > self.lowest_deg):
            raise ValueError("highest_deg must be above lowest_deg, and equal to it for a single ring")
        if self.max_m <= self.min_m:
            raise ValueError("max_m must be above min_m")
        return self

    def rotation(self) -> F64:
        """(3, 3) from the sensor's frame to base_link."""
        matrix: F64 = Rotation.from_euler("xyz", self.rpy_deg, degrees=True).as_matrix()
        return matrix

    def azimuths_rad(self) -> F64:
        """(columns,) in the sensor's frame, falling."""
        step = self.span_deg / self.columns
        azimuths: F64 = np.radians(self.first_azimuth_deg - step * np.arange(self.columns))
        return azimuths

    def elevations_rad(self) -> F64:
        """(rings,) in the sensor's frame, rising."""
        elevations: F64 = np.radians(np.linspace(self.lowest_deg, self.highest_deg, self.rings))
        return elevations

    @property
    def ring_spacing_rad(self) -> float:
        """Between neighbouring rings; 0 for a single one."""
        return float(np.radians(self.highest_deg - self.lowest_deg)) / max(1, self.rings - 1)

    def first_ground_m(self) -> float:
        """Largest distance at which a column's lowest beam meets level ground, m in plan; inf: a column never does."""
        steepest_rad, _ = _limits(self)
        return self.xyz_m[2] / float(np.tan(steepest_rad)) if steepest_rad > 0.0 else float("inf")

    def highest_slope(self) -> float:
        """Rise of its highest beam for each metre in plan, in the direction in which it is lowest."""
        return _limits(self)[1]

    def beams(self) -> F64:
        """(columns * rings, 3) unit vectors in base_link, column by column."""
        azimuths, elevations = self.azimuths_rad(), self.elevations_rad()
        flat, up = np.cos(elevations), np.sin(elevations)
        own = np.empty((len(azimuths), len(elevations), 3))
        own[..., 0] = np.cos(azimuths)[:, None] * flat
        own[..., 1] = np.sin(azimuths)[:, None] * flat
        own[..., 2] = up
        beams: F64 = own.reshape(-1, 3) @ self.rotation().T
        return beams


@lru_cache(maxsize=16)  # the beams of one sensor take some 50 ms
def _limits(sensor: RangeSensor) -> tuple[float, float]:
    """Of all columns: the least angle of the lowest beam below level, rad, and the least slope of the highest."""
    rises = sensor.beams()[:, 2].reshape(sensor.columns, sensor.rings)  # for each metre along the beam
    steepest = np.arcsin(np.clip(-rises.min(axis=1), -1.0, 1.0)).min()
    highest = np.clip(rises.max(axis=1), -1.0, 1.0).min()
    return float(steepest), float(np.tan(np.arcsin(highest)))

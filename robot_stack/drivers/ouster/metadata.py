"""Metadata of an Ouster sensor: the JSON of ``GET /api/v1/sensor/metadata``, or that of firmware before 3.

Meaning of the fields: Ouster Firmware User Manual, "Sensor Metadata".
"""

from __future__ import annotations

import json
from typing import Annotated, Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, ValidationInfo, field_validator, model_validator

from robot_stack.core.config import Config, ConfigError, validate

# Firmware 3 and later has the same names in sections.
_SECTIONS: Final = (
    "sensor_info",
    "lidar_data_format",
    "data_format",
    "beam_intrinsics",
    "lidar_intrinsics",
    "config_params",
)
_ROUNDING: Final = 1e-3  # of the entries of a rotation that is written in decimals

Angle = Annotated[float, Field(ge=-360.0, le=360.0)]
Millimetres = Annotated[float, Field(ge=-1000.0, le=1000.0)]
Matrix = Annotated[tuple[float, ...], Field(min_length=16, max_length=16)]


class Metadata(Config):
    """Angles in degrees, lengths in mm, matrices 4 x 4 by rows; of each beam from row 0, the highest, on.

    Firmware before 2.2 lacks the profile of its packets, the window and beam_to_lidar_transform: it has one
    profile, no window, and no beam that starts above or below the origin.
    """

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)

    prod_line: str
    prod_sn: Annotated[str, Field(pattern=r"^\d{1,13}$")]
    lidar_mode: Annotated[str, Field(pattern=r"^\d{3,4}x(5|10|20)$")]
    udp_profile_lidar: str = "LEGACY"
    header_type: Literal["STANDARD"] = "STANDARD"
    pixels_per_column: Annotated[int, Field(ge=1, le=256)]
    columns_per_frame: Annotated[int, Field(ge=256, le=4096)]
    columns_per_packet: Annotated[int, Field(ge=1, le=64)]
    column_window: tuple[Annotated[int, Field(ge=0)], Annotated[int, Field(ge=0)]] | None = None
    pixel_shift_by_row: tuple[int, ...]
    beam_altitude_angles: tuple[Angle, ...]
    beam_azimuth_angles: tuple[Angle, ...]
    lidar_origin_to_beam_origin_mm: Millimetres
    beam_to_lidar_transform: Matrix | None = None
    lidar_to_sensor_transform: Matrix

    @field_validator("lidar_to_sensor_transform", "beam_to_lidar_transform")
    @classmethod
    def _is_rigid(cls, value: tuple[float, ...] | None, info: ValidationInfo) -> tuple[float, ...] | None:
        if value is not None:
            turned = np.array(value).reshape(4, 4)[:3, :3]
            if np.abs(turned @ turned.T - np.eye(3)).max() > _ROUNDING or np.linalg.det(turned) < 0.0:
                raise ValueError(f"{info.field_name} must be a rotation and a translation")
        return value

    @model_validator(mode="after")
    def _fits_together(self) -> Metadata:
        for name in ("pixel_shift_by_row", "beam_altitude_angles", "beam_azimuth_angles"):
            count = len(getattr(self, name))
            if count != self.pixels_per_column:
                raise ValueError(f"{name} has {count} values for {self.pixels_per_column} pixels_per_column")
        if self.columns_per_frame % self.columns_per_packet:
            raise ValueError("columns_per_frame must be a multiple of columns_per_packet")
        if not self.lidar_mode.startswith(f"{self.columns_per_frame}x"):
            raise ValueError(f"lidar_mode {self.lidar_mode} has other columns than {self.columns_per_frame}")
        if max(self.window) >= self.columns_per_frame:
            raise ValueError(f"column_window ends beyond the {self.columns_per_frame} columns of a frame")
        return self

    @property
    def window(self) -> tuple[int, int]:
        """First and last column that are measured; the first may lie behind the last."""
        return self.column_window or (0, self.columns_per_frame - 1)

    def in_window(self, columns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(n,) True for the places of measured columns."""
        begin, end = self.window
        after, before = columns >= begin, columns <= end
        return after & before if begin <= end else after | before

    @property
    def period_s(self) -> float:
        return 1.0 / float(self.lidar_mode.rpartition("x")[2])

    def beam_origin_mm(self) -> tuple[float, float]:
        """Origin of the beams at encoder angle 0: x and z in the lidar frame."""
        if self.beam_to_lidar_transform is None:
            return self.lidar_origin_to_beam_origin_mm, 0.0
        return self.beam_to_lidar_transform[3], self.beam_to_lidar_transform[11]

    def describe(self) -> str:
        return f"{self.prod_line} {self.prod_sn}, {self.lidar_mode}, {self.udp_profile_lidar}"


def parse(text: str, source: str) -> Metadata:
    """Raises ConfigError that names ``source`` and the missing field."""
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{source}: not valid JSON: {error}") from error
    if not isinstance(data, dict):
        raise ConfigError(f"{source}: must be an object, is a {type(data).__name__}")
    return validate(Metadata, _flat(data), source)


def _flat(data: dict[str, Any]) -> dict[str, Any]:
    flat = {name: value for name, value in data.items() if name not in _SECTIONS}
    for name in reversed(_SECTIONS):  # the requested configuration never hides the active one
        section = data.get(name)
        if isinstance(section, dict):
            flat |= section
    return flat

"""``config/sim_camera.yaml``: the simulated cameras' optics, sensor and boards."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config, Fraction, NotNegative, Positive, load

Small = Annotated[float, Field(ge=0.0, le=0.05)]


class CameraTolerances(Config):
    """Largest deviations of a true camera from the calibrated one."""

    focal_length: Small
    aspect: Small
    principal_point_px: Annotated[float, Field(ge=0.0, le=20.0)]
    distortion: tuple[Small, Small, Small, Small, Small]
    position_m: Small
    rotation_rad: Small


class Shutter(Config):
    """Exposure of each row, and the time from one row to the next."""

    exposure_s: Annotated[float, Field(gt=0.0, le=0.05)]
    row_time_s: Annotated[float, Field(ge=0.0, le=1e-4)]


class Lens(Config):
    """Standard deviation of the point spread in focus; aperture and focus make it grow with distance from focus."""

    blur_px: Annotated[float, Field(ge=0.0, le=10.0)]
    aperture_m: Annotated[float, Field(ge=0.0, le=0.05)]
    focus_m: Positive


class Sensor(Config):
    """Numbers of the sensor; dn: grey levels of the 8-bit image."""

    white_dn: Annotated[float, Field(gt=0.0, le=255.0)]
    read_noise_dn: NotNegative
    full_well_e: Positive
    max_gain: Annotated[float, Field(ge=1.0)]


class BoardPaint(Config):
    """Reflectances of a marker board and the panel's rim around the quiet zones."""

    white: Fraction
    black: Fraction
    panel: Fraction
    cover: Fraction
    dirt: Fraction
    margin_m: NotNegative


class BackdropParams(Config):
    """Everything behind the boards."""

    divisor: Annotated[int, Field(ge=1, le=16)]
    sun_azimuth_rad: Annotated[float, Field(ge=-2.0 * math.pi, le=2.0 * math.pi)]
    sun_elevation_rad: Annotated[float, Field(gt=0.0, lt=0.5 * math.pi)]


class CameraParams(Config):
    """Everything in ``config/sim_camera.yaml``."""

    tolerances: CameraTolerances
    shutter: Shutter
    lens: Lens
    sensor: Sensor
    board: BoardPaint
    backdrop: BackdropParams


def load_camera_params() -> CameraParams:
    """``config/sim_camera.yaml``. Raises ConfigError."""
    return load(CameraParams, "sim_camera")

"""Parameters of films, ``config/film.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config, Positive


class Camera(Config):
    """The camera's place: azimuth and elevation of its viewing direction, degrees."""

    distance_m: Annotated[float, Field(ge=2.0, le=100.0)]
    elevation_deg: Annotated[float, Field(ge=10.0, le=89.0)]
    azimuth_deg: Annotated[float, Field(ge=-360.0, le=360.0)]
    field_of_view_deg: Annotated[float, Field(ge=10.0, le=90.0)]
    calm_s: Annotated[float, Field(ge=0.0, le=10.0)]


class FilmParams(Config):
    # The encoders require even sizes.
    width_px: Annotated[int, Field(ge=160, le=1920, multiple_of=2)]
    height_px: Annotated[int, Field(ge=120, le=1080, multiple_of=2)]
    length_s: Annotated[float, Field(ge=1.0, le=600.0)]
    frame_hz: Annotated[float, Field(ge=1.0, le=60.0)]
    supersampling: Annotated[int, Field(ge=1, le=4)]
    gif_colours: Annotated[int, Field(ge=8, le=256)]
    sample_hz: Annotated[float, Field(ge=1.0, le=100.0)]
    standing_mps: Positive
    turning_m: Positive
    camera: Camera
    wall_height_m: Positive
    obstacle_height_m: Positive

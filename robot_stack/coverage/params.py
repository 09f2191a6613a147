"""Parameters of ``robot-stack coverage``, ``config/coverage.yaml``, and the layouts to compare."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config, Positive, load
from robot_stack.core.range_sensor import RangeSensor


class CoverageParams(Config):
    """Sizes in m, and the thresholds of a seen cell."""

    band_m: Positive
    cell_m: Annotated[float, Field(ge=0.01, le=0.5)]
    thing_width_m: Positive
    thing_heights_m: Annotated[tuple[Positive, ...], Field(min_length=1)]
    lowest_point_m: Annotated[float, Field(ge=0.0)]
    points_min: Annotated[int, Field(ge=1)]
    edge_columns: Annotated[int, Field(ge=0, le=20)]
    map_heights_m: Annotated[tuple[Positive, ...], Field(min_length=1)]
    slab_m: Positive


class Layout(Config):
    """Sensors by name. robot: sensors from ``config/robot.yaml``; own: additional ones."""

    what: str
    robot: tuple[str, ...]
    own: dict[str, RangeSensor]


class Layouts(Config):
    """``config/coverage_layouts.yaml``: candidates for the robot's sensors."""

    layouts: dict[str, Layout]


def load_coverage_params() -> CoverageParams:
    """Raises ConfigError."""
    return load(CoverageParams, "coverage")


def load_layouts() -> Layouts:
    """Raises ConfigError."""
    return load(Layouts, "coverage_layouts")

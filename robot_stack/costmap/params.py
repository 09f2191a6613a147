"""Parameters of the node costmap_server, ``config/costmap_server.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


class MarkingParams(Config):
    """How long a mark lives.

    clear_after_s: a mark that was seen within this time is not cleared by a ray. in_view_s: lifetime of a mark that
    nothing hides and that is not seen again, out_of_view_s: of one that something hides and that has been seen for
    steady_s before.
    """

    clear_after_s: NotNegative
    in_view_s: Positive
    out_of_view_s: Positive
    steady_s: NotNegative
    lowest_ray_deg: Annotated[float, Field(gt=-90.0, lt=0.0)]
    ray_margin_m: NotNegative

    @model_validator(mode="after")
    def _in_order(self) -> MarkingParams:
        if not self.clear_after_s < self.in_view_s <= self.out_of_view_s:
            raise ValueError("clear_after_s, in_view_s, out_of_view_s must grow in this order")
        return self


class InflationParams(Config):
    """How far around obstacles driving costs something: ``beyond_m`` more than the footprint reaches."""

    beyond_m: NotNegative
    scaling_per_m: Positive


class OdometryParams(Config):
    """Poses by stamp: how many are kept, how far ahead of the newest one is guessed, what is no motion."""

    history_s: Positive
    ahead_s: NotNegative
    jump_m: Positive


class CostmapParams(Config):
    """Everything in ``config/costmap_server.yaml``."""

    size_m: Annotated[float, Field(ge=2.0, le=50.0)]
    resolution_m: Annotated[float, Field(ge=0.01, le=0.5)]
    directions: Annotated[int, Field(ge=36, le=7200)]
    marking: MarkingParams
    inflation: InflationParams
    odometry: OdometryParams

"""Parameters of the node perception_pipeline, ``config/perception_pipeline.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Count = Annotated[int, Field(ge=1)]


class CropParams(Config):
    """What is cut away: invalid ranges, the robot itself, the attached chair with its passenger."""

    range_min_m: Positive
    range_max_m: Positive
    robot_margin_m: NotNegative
    robot_height_m: Positive
    chair_height_m: Positive
    below_m: NotNegative

    @model_validator(mode="after")
    def _min_below_max(self) -> CropParams:
        if self.range_min_m >= self.range_max_m:
            raise ValueError("range_min_m must be smaller than range_max_m")
        return self


class DeskewParams(Config):
    """The motion during a sweep."""

    step_s: Positive
    longest_s: Positive
    odometry_silent_s: Positive
    history_s: Positive
    attitude_silent_s: Positive


class Bins(Config):
    """Cells of ``length_m`` out to ``radius_m``."""

    radius_m: Positive
    length_m: Annotated[float, Field(ge=0.05)]


class GroundParams(Config):
    """The ground: cells around the sensor, the slope it may have, and what counts as a step."""

    sectors: Annotated[int, Field(ge=36, le=3600)]
    bins: Annotated[list[Bins], Field(min_length=1)]
    max_slope_deg: Annotated[float, Field(gt=0.0, lt=45.0)]
    range_sigma_m: Positive
    step_tolerance_m: Positive
    drop_tolerance_m: Positive
    point_tolerance_m: Positive
    low_band_m: Positive
    outlier_gap_m: Positive
    drop_min_m: Positive
    drop_points_min: Count
    lateral_cone_m: Positive
    wall_extent_m: Positive
    wall_foot_m: Positive
    kerb_height_m: Positive
    kerb_point_m: Positive
    kerb_gap_m: Positive
    kerb_rise_m: Positive
    kerb_range_m: Positive
    deck_m: Positive
    edge_range_m: Positive
    obstacle_min_m: Positive
    obstacle_max_m: Positive

    @model_validator(mode="after")
    def _ordered(self) -> GroundParams:
        radii = [item.radius_m for item in self.bins]
        if radii != sorted(set(radii)):
            raise ValueError("bins: radius_m must grow")
        if self.obstacle_min_m >= self.obstacle_max_m:
            raise ValueError("obstacle_min_m must be smaller than obstacle_max_m")
        return self


class ObstacleParams(Config):
    """Thinning of the obstacle points."""

    range_m: Positive
    voxel_m: Positive
    neighbourhood_m: Positive
    neighbours_min: Count


class FreeSpaceParams(Config):
    """How far the ground counts as seen."""

    directions: Annotated[int, Field(ge=36, le=7200)]
    first_ground_m: Positive
    ring_spacing_rad: Positive
    gap_factor: Annotated[float, Field(ge=1.0)]
    gap_m: Positive


class WatchParams(Config):
    """When a sweep cannot be trusted."""

    stamp_future_s: Positive
    stamp_old_s: Positive
    sectors: Annotated[int, Field(ge=4, le=360)]
    sector_points_min: Count
    sector_silent_s: Positive
    blind_sectors_max: Annotated[int, Field(ge=0)]
    blind_gap_m: Positive
    seen_min_m: Positive
    points_min: Count
    remembered: Annotated[int, Field(ge=1, le=20)]
    sample: Count


class OutputParams(Config):
    """When full sweeps are taken instead of halves, and how long the other half is shown again."""

    full_sweep_after_s: Positive
    keep_s: Positive


class PerceptionParams(Config):
    """Everything the node can be told."""

    crop: CropParams
    deskew: DeskewParams
    ground: GroundParams
    obstacles: ObstacleParams
    free_space: FreeSpaceParams
    watch: WatchParams
    output: OutputParams

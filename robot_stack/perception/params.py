"""Parameters of the node perception_pipeline, ``config/perception_pipeline.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config, Count, NotNegative, Positive


class CropParams(Config):
    """Removal of invalid ranges, the robot itself, the attached chair with its passenger."""

    range_min_m: Positive
    range_max_m: Positive
    robot_margin_m: NotNegative
    robot_height_m: Positive
    mast_margin_m: NotNegative
    mast_columns: NotNegative
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
    steep_slope_deg: Annotated[float, Field(gt=0.0, lt=45.0)]
    steep_m: Positive
    steep_tolerance_m: Positive
    deck_m: Positive
    obstacle_min_m: Positive
    obstacle_max_m: Positive

    @model_validator(mode="after")
    def _ordered(self) -> GroundParams:
        radii = [item.radius_m for item in self.bins]
        if radii != sorted(set(radii)):
            raise ValueError("bins: radius_m must grow")
        if not self.max_slope_deg < self.steep_slope_deg:
            raise ValueError("steep_slope_deg must be greater than max_slope_deg")
        if self.obstacle_min_m >= self.obstacle_max_m:
            raise ValueError("obstacle_min_m must be smaller than obstacle_max_m")
        return self


class ObstacleParams(Config):
    """Thinning of the obstacle points.

    A point is kept if cells of neighbourhood_m around it hold as many returns as an object of smallest_m2 would give
    there, at least neighbours_min, at most neighbours_max; returns count up to neighbour_rings above or below it, or as
    far as a cell is wide. With doubt_share of them, at any height, it adds no obstacle, but keeps an existing one.
    """

    range_m: Positive
    voxel_m: Positive
    far_m: Positive
    far_column_m: Positive
    neighbourhood_m: Positive
    neighbour_rings: Positive
    neighbours_min: Count
    neighbours_max: Annotated[int, Field(ge=1, le=250)]
    smallest_m2: Positive
    doubt_share: Annotated[float, Field(gt=0.0, le=1.0)]

    @model_validator(mode="after")
    def _ordered(self) -> ObstacleParams:
        if self.neighbours_min > self.neighbours_max:
            raise ValueError("neighbours_min must not be greater than neighbours_max")
        return self


class FreeSpaceParams(Config):
    """How far the ground counts as observed."""

    first_ground_factor: Annotated[float, Field(ge=1.0)]
    gap_factor: Annotated[float, Field(ge=1.0)]
    gap_m: Positive


class WatchParams(Config):
    """Rejection of sweeps."""

    stamp_future_s: Positive
    stamp_old_s: Positive
    sectors: Annotated[int, Field(ge=4, le=360)]
    low_beam_m: Positive
    obstructed_min: Count
    sector_points_min: Count
    sector_silent_s: Positive
    blind_sectors_max: Annotated[int, Field(ge=0)]
    blind_gap_m: Positive
    seen_min_m: Positive
    points_min: Count
    remembered: Annotated[int, Field(ge=1, le=20)]
    sample: Count

    @model_validator(mode="after")
    def _whole_degrees(self) -> WatchParams:
        if 360 % self.sectors:
            raise ValueError("sectors must divide 360: each holds whole directions of 1 deg")
        return self


class OverheadParams(Config):
    """Selection of the overhead LiDAR's points, and how long they are published again."""

    range_m: Positive
    keep_s: Positive


class MixedPixelParams(Config):
    """Filter of mixed pixels between the attached chair's edge and the background.

    points_min, overhead_points_min: in a cell and the eight beside it, of a half sweep and of the overhead LiDAR's
    frame. beyond_m: of the chair's box; farther from base_link along x and y no pixel is mixed with the chair.
    """

    beyond_m: Positive
    cell_m: Annotated[float, Field(ge=0.01)]
    points_min: Count
    overhead_points_min: Count


class OutputParams(Config):
    """When full sweeps replace halves, and how long the other half is published again."""

    full_sweep_after_s: Positive
    keep_s: Positive


class MovingObjectParams(Config):
    """Tracking of moving objects: returns in places that were free before, tracked from view to view of one sensor.

    A return is new if its place was free ``new_s`` ago, and no older obstacle is within ``apart_m``. Returns within
    ``link_m`` of each other are one object, if they are at least ``points_min`` and no more than ``widest_m`` apart;
    one with less than the share ``whole`` of its earlier returns is becoming hidden. An object is associated within
    ``gate_m`` of its prediction, and predicted for ``coast_s`` after its last detection, but only ``missed_s`` where
    rays pass below its top; a moving one is assumed to continue for that time, an approaching one for at least 1.6 m,
    up to ``beside_m`` before the robot, in unobserved space. place_sigma_m, acceleration_mps2: noise of measurement and
    motion. It moves if it was tracked for ``follow_s`` and over ``distance_m``, is faster than ``slowest_mps`` and,
    until it moves, than ``sure`` times the deviation of its speed, and at most the share ``vacated_share`` of its
    points of ``vacated_s`` ago has one within ``same_m`` now; later on, at most that share of the points that its
    motion should have left.
    """

    new_s: Positive
    apart_m: NotNegative
    link_m: Positive
    points_min: Count
    widest_m: Positive
    whole: Annotated[float, Field(ge=0.0, le=1.0)]
    gate_m: Positive
    missed_s: Positive
    coast_s: Positive
    beside_m: NotNegative
    place_sigma_m: Positive
    acceleration_mps2: Positive
    follow_s: Positive
    distance_m: Positive
    slowest_mps: Positive
    fastest_mps: Positive
    sure: Positive
    vacated_s: Positive
    same_m: Positive
    vacated_share: Annotated[float, Field(ge=0.0, le=1.0)]


class SpaceParams(Config):
    """The model of the space around the robot.

    passes: views whose rays must pass through an occupied cell to free it, at least ``top_margin_m`` below
    its top; or, if that is no higher than ``low_m``, that show ground in its place. A return within ``thing_m`` of a
    higher one is part of the same object. free_below_m: a ray this low makes an
    unseen cell free; rays lower than the LiDAR keep it free. ``fade_s`` after the last of them it is unseen again,
    if a person could have entered it: from another such place, or from returns within ``enter_m`` of it.
    memory_m: motion, a turn counting by ``lever_m``, after which the place of an obstacle not observed since is no
    longer reliable.
    jump_m, jump_rad: motion between two views, beyond what the greatest speeds explain, of a restarted odometry.
    """

    size_m: Annotated[float, Field(ge=2.0, le=50.0)]
    cell_m: Annotated[float, Field(ge=0.01, le=0.5)]
    passes: Annotated[int, Field(ge=1, le=100)]
    top_margin_m: NotNegative
    low_m: NotNegative
    thing_m: NotNegative
    free_below_m: Positive
    fade_s: Positive
    enter_m: NotNegative
    memory_m: Positive
    lever_m: NotNegative
    jump_m: Positive
    jump_rad: Positive
    attach_margin_m: NotNegative
    moving_objects: MovingObjectParams

    @property
    def reach_m(self) -> float:
        """Largest distance of evaluated rays from a sensor: the corners are farther than the sides."""
        return 0.75 * self.size_m


class PeopleParams(Config):
    """Clusters of occupied cells that may be people, and how moving bodies and clusters are followed.

    join_m: cells nearer than this are one cluster. min_size_m, max_size_m: longer side of a person's cluster.
    min_radius_m, max_radius_m: of a person. fresh_s: age of the returns that count. gate_m: from one grid to the next.
    body_gate_m: between the bodies of two sensors that are one. memory_s: without a detection. position_gain: of a
    standing one's detection. group_s: without a gap to others.
    """

    join_m: Positive
    min_size_m: Positive
    max_size_m: Positive
    min_radius_m: Positive
    max_radius_m: Positive
    fresh_s: Positive
    gate_m: Positive
    body_gate_m: Positive
    memory_s: Positive
    position_gain: Annotated[float, Field(gt=0.0, le=1.0)]
    group_s: Positive


class FastBodyParams(Config):
    """The coarser and larger grid in which bodies are tracked that are too fast for the first one.

    All values: as in ``SpaceParams``; the others are those of the first grid.
    """

    size_m: Annotated[float, Field(ge=2.0, le=50.0)]
    cell_m: Annotated[float, Field(ge=0.01, le=0.5)]
    free_below_m: Positive
    moving_objects: MovingObjectParams

    def space(self, first: SpaceParams) -> SpaceParams:
        """Parameters of this grid, given those of the first one."""
        return first.model_copy(update=dict(self))


class FootingParams(Config):
    """Where the ground falls.

    An edge is where it falls by more than ``fall_m`` from one patch of 0.15 m to the next, and by ``more_m`` more than
    before or behind it; or by more than ``steep_m``. Across hidden ground, ramps of ``slope_deg`` may explain the fall,
    up to ``gap_m`` away. sigma_m: of one return's height, three times; returns_max: number of latest returns in a
    cell's height. range_m: around base_link, where edges are searched. reach_m: distance beyond known footing from
    which ground counts as missing.
    """

    fall_m: Positive
    more_m: Positive
    steep_m: Positive
    slope_deg: Annotated[float, Field(gt=0.0, lt=45.0)]
    sigma_m: Positive
    gap_m: Positive
    range_m: Positive
    returns_max: Annotated[int, Field(ge=1, le=1000)]
    reach_m: Positive


class PerceptionParams(Config):
    """All parameters of the node.

    slow_bodies: those below walking speed, tracked while the robot stands. people: in the grid of ``space``.
    """

    crop: CropParams
    deskew: DeskewParams
    ground: GroundParams
    obstacles: ObstacleParams
    free_space: FreeSpaceParams
    watch: WatchParams
    overhead: OverheadParams
    mixed_pixels: MixedPixelParams
    space: SpaceParams
    slow_bodies: MovingObjectParams
    fast_bodies: FastBodyParams
    people: PeopleParams
    footing: FootingParams
    output: OutputParams

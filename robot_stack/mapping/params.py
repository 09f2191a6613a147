"""Parameters of the map builder, ``config/mapping.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config, Fraction, Positive


class Sweeps(Config):
    """Which sweeps are used and how many points of each."""

    nearest_m: Positive
    voxel_m: Annotated[float, Field(ge=0.02, le=0.5)]
    step_m: Annotated[float, Field(ge=0.0)]
    step_rad: Annotated[float, Field(ge=0.0)]
    fewest: Annotated[int, Field(ge=2)]
    fewest_points: Annotated[int, Field(ge=10)]
    odometry_gap_s: Positive


class LidarOdometry(Config):
    """KISS-ICP on the points above the ground."""

    voxel_m: Positive
    max_range_m: Positive
    points_per_voxel: Annotated[int, Field(ge=1)]
    ground_cell_m: Positive
    above_ground_m: Positive
    correspondence_m: Positive
    kernel_m: Positive
    iterations: Annotated[int, Field(ge=1)]
    deviation_m: Positive
    deviation_rad: Positive
    fewest_points: Annotated[int, Field(ge=1)]


class WheelOdometry(Config):
    """Deviations of wheel odometry, gyro and attitude between two sweeps."""

    deviation_m: Positive
    deviation_share: Positive
    deviation_rad: Positive
    deviation_rad_per_m: Positive
    gyro_deviation_radps: Positive
    standing_mps: Positive
    standing_radps: Positive
    standing_s: Positive
    level_deviation_rad: Positive


class Loops(Config):
    time_apart_s: Positive
    radius_m: Positive
    drift_share: Fraction
    every_m: Positive
    window: Annotated[int, Field(ge=0)]
    voxels_m: Annotated[tuple[float, ...], Field(min_length=1)]
    fewest_share: Fraction
    deviation_m: Positive
    deviation_rad: Positive
    robust: Positive


class Joining(Config):
    """Several rides in one map: how one is placed among the others, and when the result is doubted."""

    every_m: Positive
    point_m: Positive
    range_m: Positive
    agree_m: Positive
    agree_rad: Positive
    fewest: Annotated[int, Field(ge=2)]
    rival_share: Fraction
    deviation_m: Positive
    deviation_rad: Positive
    flat_m: Positive
    wall_warning_m: Positive


class Refinement(Config):
    rounds: Annotated[int, Field(ge=0)]
    voxels_m: Annotated[tuple[float, ...], Field(min_length=1)]
    cell_points: Annotated[int, Field(ge=3)]
    points: Annotated[int, Field(ge=100)]
    range_m: Positive
    deviation_m: Positive
    deviation_rad: Positive
    fewest_share: Fraction


class MovingObjectParams(Config):
    voxel_m: Positive
    margin_m: Positive
    range_m: Positive
    through_per_hit: Positive
    fewest_through: Annotated[int, Field(ge=1)]
    above_ground_m: Positive


class CellSize(Config):
    size_m: Positive
    fewest_points: Annotated[int, Field(ge=6)]
    fewest_sweeps: Annotated[int, Field(ge=1)]
    range_m: Positive


class GridSettings(Config):
    resolution_m: Annotated[float, Field(ge=0.02, le=0.5)]
    range_m: Positive
    fewest_ground_points: Annotated[int, Field(ge=1)]
    ground_band_m: Positive
    step_m: Positive
    slope: Positive
    noise_m: Positive
    bump_m: Positive
    bump_share: Fraction
    bump_width_m: Positive
    fewest_cells: Annotated[int, Field(ge=1)]
    structure_from_m: Positive
    structure_to_m: Positive
    fewest_structure_points: Annotated[int, Field(ge=1)]


class Mount(Config):
    """Estimation of the LiDAR's mounting, ``robot-stack calibrate lidar``."""

    nearest_m: Positive
    farthest_m: Positive
    band_m: Positive
    narrowest_band_m: Positive
    fewest_points: Annotated[int, Field(ge=3)]
    fewest_sweeps: Annotated[int, Field(ge=3)]
    step_m: Positive
    shortest_m: Positive
    deviation_deg: Positive


class CameraMount(Config):
    """Estimation of a camera's mounting, ``robot-stack calibrate extrinsics``."""

    fewest_views: Annotated[int, Field(ge=10)]
    least_turn_deg: Positive
    stand_s: Positive
    stand_m: Positive
    stand_deg: Positive
    apart_m: Positive
    apart_deg: Positive
    deviation_deg: Positive
    deviation_m: Positive


class Teach(Config):
    """Timeouts, display and warnings of ``robot-stack map teach``."""

    points_within_s: Positive
    silent_s: Positive
    speed_mps: Positive
    turn_radps: Positive
    standing_mps: Positive
    standing_radps: Positive
    begin_s: Positive
    idle_s: Positive
    apart_m: Positive
    apart_share: Fraction
    line_s: Positive
    picture_s: Positive
    picture_px: Annotated[int, Field(ge=100, le=8000)]


class MappingParams(Config):
    sweeps: Sweeps
    lidar_odometry: LidarOdometry
    wheel_odometry: WheelOdometry
    loops: Loops
    joining: Joining
    refinement: Refinement
    moving_objects: MovingObjectParams
    cells: CellSize
    grid: GridSettings
    mount: Mount
    camera_mount: CameraMount
    teach: Teach

"""Parameters of the rows about the surroundings: part of ``config/safety_monitor.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.contract import topics
from robot_stack.core.config import Config, NotNegative, Positive


class CollisionParams(Config):
    """Thresholds of a motion's approach to obstacles, and its speed limits.

    A raised row clears above its threshold plus the hysteresis. The limit lets the robot reach the obstacle in
    ``approach_s`` at the earliest and stop at ``stop_clearance_m`` after ``reaction_s``; it is never less than the
    slowest speeds, because COLLISION_IMMINENT stops the robot. unseen_mps: the least limit where the way
    is neither seen nor remembered. ground_margin_m: with a passenger the robot stops this far before known ground ends.
    """

    margin_m: NotNegative
    stop_s: Positive
    stop_clearance_m: Positive
    near_s: Positive
    near_clearance_m: Positive
    hysteresis_s: Positive
    hysteresis_m: Positive
    approach_s: Positive
    reaction_s: Positive
    slowest_mps: Positive
    slowest_radps: Positive
    step_mps: Positive
    unseen_mps: Positive
    ground_margin_m: NotNegative
    rest_mps: Positive
    rest_radps: Positive

    @model_validator(mode="after")
    def _in_order(self) -> CollisionParams:
        if not self.stop_s < self.approach_s < self.near_s:
            raise ValueError("stop_s, approach_s, near_s must grow in this order")
        if not self.margin_m < self.stop_clearance_m < self.near_clearance_m:
            raise ValueError("margin_m, stop_clearance_m, near_clearance_m must grow in this order")
        return self


class PedestrianCollisionParams(Config):
    """Collisions with pedestrians.

    A contact is a distance to the footprint below ``margin_m``, which grows with the time ahead by ``drift_mps`` or,
    if that is more, the share ``drift_share`` of the body's speed.
    reaction_s: from a person's position to the robot's brakes. The speed is limited so that no stop is needed within
    ``ahead_s``, in ``shares`` equal steps. A motion is predicted to ``horizon_s`` in steps of ``step_s``. After a
    person walks up to the robot within ``ahead_s``, it holds for ``hold_s`` while anything is nearer than ``beside_m``,
    or was and is gone by more than ``leaves_m`` within a tick.
    """

    margin_m: NotNegative
    drift_mps: NotNegative
    drift_share: NotNegative
    reaction_s: Positive
    ahead_s: Positive
    shares: Annotated[int, Field(ge=1, le=20)]
    horizon_s: Positive
    step_s: Positive
    beside_m: Positive
    leaves_m: Positive
    hold_s: Positive


class VolumeParams(Config):
    """In the dock's frame, m: x from rear to front, |y| from inner to outer, z up to top."""

    rear_m: float
    front_m: float
    inner_m: NotNegative
    outer_m: Positive
    top_m: Positive

    @model_validator(mode="after")
    def _has_room(self) -> VolumeParams:
        if not (self.rear_m < self.front_m and self.inner_m < self.outer_m):
            raise ValueError("rear_m must be less than front_m, inner_m less than outer_m")
        return self


class ExclusionParams(Config):
    """The parts of a dock: its body including a seated person, and the rails that extend towards the robot."""

    body: VolumeParams
    rails: VolumeParams


class ObstacleParams(Config):
    """Storage of obstacle clouds: duration, radius around the robot, one point for each upright column.

    sight_stale_s: points older than this limit the speed (SIGHT_STALE), before OBSTACLES_TIMEOUT is raised.
    """

    window_s: Positive
    sight_stale_s: Positive
    radius_m: Positive
    column_m: Positive
    max_latency_s: Positive
    exclusion: ExclusionParams

    @model_validator(mode="after")
    def _limits_before_the_row(self) -> ObstacleParams:
        if not self.sight_stale_s < topics.OBSTACLES.stale_limit_s:
            raise ValueError(f"sight_stale_s must be less than {topics.OBSTACLES.stale_limit_s:g}: then it is a row")
        return self


class LidarParams(Config):
    """Criteria of a valid sweep, judged on ``sample`` of its points."""

    sample: Annotated[int, Field(ge=64)]
    min_range_m: Positive
    max_range_m: Positive
    min_returns: Annotated[int, Field(ge=1)]
    sectors: Annotated[int, Field(ge=4)]
    min_sector_share: Annotated[float, Field(gt=0.0, le=1.0)]

    @model_validator(mode="after")
    def _in_order(self) -> LidarParams:
        if not self.min_range_m < self.max_range_m:
            raise ValueError("min_range_m must be less than max_range_m")
        return self

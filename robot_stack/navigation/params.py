"""Parameters of the navigation controller, ``config/navigation_controller.yaml``."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config, NotNegative, Positive, Share


class LimitParams(Config):
    """How much of the robot's limits (``config/robot.yaml``) a plan uses; the rest is a reserve for the feedback."""

    cruise_speed_mps: Positive
    speed_share: Share
    acceleration_share: Share
    jerk_share: Share
    turning_share: Share
    stop_below_mps: Positive


class GoalParams(Config):
    """Limits of accepted goals, and the tolerances of a reached one."""

    max_distance_m: Positive
    max_age_s: Positive
    position_tolerance_m: Positive
    yaw_tolerance_rad: Positive
    settled_position_m: Positive
    settled_yaw_rad: Positive
    settle_s: Positive
    arrival_speed_mps: Positive
    arrival_yaw_rate_radps: Positive

    @model_validator(mode="after")
    def _settled_is_tighter(self) -> GoalParams:
        for settled, tolerance in (
            ("settled_position_m", "position_tolerance_m"),
            ("settled_yaw_rad", "yaw_tolerance_rad"),
        ):
            if getattr(self, settled) >= getattr(self, tolerance):
                raise ValueError(f"{settled} must be smaller than {tolerance}")
        return self


class TrackingParams(Config):
    """Feedback and feed-forward."""

    command_delay_s: NotNegative
    position_gain_per_s: Positive
    yaw_gain_per_s: Positive
    max_correction_mps: Positive
    max_correction_radps: Positive
    start_ahead_s: Positive
    start_moved_m: Positive
    start_moved_rad: Positive
    start_timeout_s: Positive
    wait_from_m: Positive
    wait_at_m: Positive
    wait_from_rad: Positive
    wait_at_rad: Positive
    replan_position_m: Positive
    replan_yaw_rad: Positive
    replan_interval_s: Positive
    max_step_s: Positive

    @model_validator(mode="after")
    def _waits_before_it_plans_afresh(self) -> TrackingParams:
        if not self.wait_from_m < self.wait_at_m < self.replan_position_m:
            raise ValueError("wait_from_m < wait_at_m < replan_position_m must hold")
        if not self.wait_from_rad < self.wait_at_rad < self.replan_yaw_rad:
            raise ValueError("wait_from_rad < wait_at_rad < replan_yaw_rad must hold")
        return self


class PoseParams(Config):
    """Timeouts of pose and odometry."""

    pose_timeout_s: Positive
    odometry_timeout_s: Positive
    max_extrapolation_s: Positive
    history_s: Positive
    max_speed_factor: Annotated[float, Field(ge=1.0)]
    jump_tolerance_m: Positive
    jump_tolerance_rad: Positive


class PlannerParams(Config):
    """The global route. Distances of the footprint's edge, or of cells, from obstacles."""

    search_resolution_m: Positive
    margin_m: Positive
    easy_margin_m: Positive
    goal_margin_m: Positive
    prefer_m: Positive
    near_cost: NotNegative
    unknown_is_passable: bool
    unknown_cost: Annotated[float, Field(ge=1.0)]
    heuristic_weight: Annotated[float, Field(ge=1.0, le=3.0)]
    heading_bins: Annotated[int, Field(ge=8, le=180)]
    turn_cost_m_per_rad: Positive
    rounding: Annotated[int, Field(ge=0, le=50)]
    escape_m: NotNegative
    closed_radius_m: Positive
    tries: Annotated[int, Field(ge=1, le=20)]
    open_pad_m: Positive
    open_resolution_m: Positive
    memory_s: Positive


class OneWayParams(Config):
    """Motion in the site's one-way zones. tolerance_rad: a course farther off the zone's heading is against it."""

    tolerance_rad: Annotated[float, Field(gt=0.5 * math.pi, lt=math.pi)]
    back_m: Positive


class GraphParams(Config):
    """Long routes over the lanes of the site's route graph."""

    from_m: Positive
    band_m: Annotated[float, Field(gt=0.0, lt=3.0)]  # distances beside a lane are computed up to 3 m
    access_m: Positive
    off_lane_cost: Annotated[float, Field(ge=1.0)]
    tries: Annotated[int, Field(ge=1, le=50)]


class DoorParams(Config):
    """Doors of the site. stop_m: before the zone. answer_s, and lift_answer_s for the doors of lifts: a robot that has
    waited for longer asks staff. relocation_s: until a change of the level in the map is repeated.
    """

    stop_m: Positive
    answer_s: Positive
    lift_answer_s: Positive
    relocation_s: Positive


class LocalParams(Config):
    """The sampling controller. weights: progress, offset, heading, clearance, person, change of offset."""

    seed: int
    step_s: Positive
    steps: Annotated[int, Field(ge=5, le=60)]
    max_offset_m: Positive
    offsets: Annotated[int, Field(ge=3, le=31)]
    max_turn_rad: Positive
    samples: Annotated[int, Field(ge=8, le=512)]
    rounds: Annotated[int, Field(ge=0, le=5)]
    elite: Annotated[int, Field(ge=1, le=64)]
    spread: tuple[Positive, Positive, Positive]
    hard_margin_m: Positive
    soft_margin_m: Positive
    person_margin_m: Positive
    weights: tuple[Positive, Positive, Positive, Positive, Positive, Positive]
    governor_margin_m: Positive
    governor_s: Positive

    @model_validator(mode="after")
    def _hard_is_nearer(self) -> LocalParams:
        if self.hard_margin_m >= self.soft_margin_m:
            raise ValueError("hard_margin_m must be smaller than soft_margin_m")
        return self


class SpeedLimitParams(Config):
    """Speed by clearance of the footprint."""

    slow_clearance_m: Positive
    slow_speed_mps: Positive
    free_clearance_m: Positive
    braking_share: Share

    @model_validator(mode="after")
    def _free_is_farther(self) -> SpeedLimitParams:
        if self.slow_clearance_m >= self.free_clearance_m:
            raise ValueError("slow_clearance_m must be smaller than free_clearance_m")
        return self


class PeopleParams(Config):
    """The distances and speeds to keep from people. sightings: people seen less often are not shown."""

    sightings: Annotated[int, Field(ge=1)]
    walking_gap_m: Positive
    standing_gap_m: Positive
    near_m: Positive
    near_mps: Positive
    very_near_m: Positive
    very_near_mps: Positive
    yield_horizon_s: Positive
    yield_time_s: Positive
    yield_gap_m: Positive
    yield_pace_mps: Positive
    yield_stop_m: Positive
    yield_most_s: NotNegative


class PassingParams(Config):
    """Passing people who come along the way on one side of it.

    room_m: the room that the robot makes for them. margin_m: clearance beside the route. ahead_m: of people who come,
    and standing_m of those who have stopped, from the robot's front. fade_m: back to the route within this distance.
    near_m: before people who are nearer than this, the robot moves sideways at once, to done_m of the side.
    """

    room_m: Positive
    margin_m: Positive
    ahead_m: Positive
    standing_m: Positive
    least_m: Positive
    fade_m: Positive
    near_m: Positive
    done_m: Positive
    speed_mps: Positive
    gain_per_s: Positive


class GiveWayParams(Config):
    """Making room if a person and the robot block each other."""

    near_m: Positive
    room_m: Positive
    least_m: Positive
    speed_mps: Positive
    turn_radps: Positive
    look_s: Positive
    watch_m: Positive
    most_s: Positive
    tries: Annotated[int, Field(ge=0, le=10)]

    @model_validator(mode="after")
    def _makes_room(self) -> GiveWayParams:
        if self.least_m >= self.speed_mps * self.look_s:
            raise ValueError("least_m must be smaller than speed_mps x look_s")
        return self


class PassageParams(Config):
    """Narrow places, where the planned poses are driven exactly."""

    narrow_m: Positive
    ahead_m: Positive
    turn_m: Positive
    off_m: Positive
    off_rad: Positive
    margin_m: Positive
    speed_mps: Positive
    wait_m: Positive
    wait_s: Positive


class FollowParams(Config):
    """Following a route, switching to the exact motion to the goal where it is free, and giving up."""

    costmap_timeout_s: Positive
    ahead_m: Positive
    direct_margin_m: Positive
    direct_leave_m: Positive
    direct_near_m: Positive
    direct_end_margin_m: Positive
    direct_any_heading_m: Positive
    direct_heading_rad: Positive
    direct_person_m: Positive
    direct_end_person_m: Positive
    direct_interval_s: Positive
    blocked_margin_m: Positive
    replan_interval_s: Positive
    stuck_s: Positive
    stuck_mps: Positive
    off_route_m: Positive
    give_up_s: Positive
    progress_m: Positive

    @model_validator(mode="after")
    def _leaves_later_than_it_enters(self) -> FollowParams:
        if self.direct_leave_m >= self.direct_margin_m:
            raise ValueError("direct_leave_m must be smaller than direct_margin_m")
        return self


class NavigationParams(Config):
    """All parameters of the node."""

    map: str
    use_costmap: bool

    plan_spacing_m: Positive
    plan_max_poses: Annotated[int, Field(ge=2)]
    standing_speed_mps: Positive
    standing_yaw_rate_radps: Positive
    limits: LimitParams
    goal: GoalParams
    tracking: TrackingParams
    pose: PoseParams
    planner: PlannerParams
    one_way: OneWayParams
    graph: GraphParams
    door: DoorParams
    local: LocalParams
    speed_limits: SpeedLimitParams
    people: PeopleParams
    passing: PassingParams
    give_way: GiveWayParams
    passage: PassageParams
    follow: FollowParams

    @model_validator(mode="after")
    def _planned_recovery_may_be_driven(self) -> NavigationParams:
        if self.one_way.back_m < self.planner.escape_m:
            raise ValueError("one_way.back_m must not be below planner.escape_m")
        return self

"""Parameters of matching, gates and search: section ``ndt`` of ``config/ndt_localization.yaml``."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Count = Annotated[int, Field(ge=1)]


class CloudParams(Config):
    """What of a sweep is matched. sweep_s: how long before its stamp a sweep may have begun."""

    voxel_m: Positive
    min_range_m: Positive
    max_range_m: Positive
    min_points: Count
    sweep_s: Positive


class LevelParams(Config):
    """One resolution of the map.

    cell_m: edge of its cells, those of the map are merged to it. blur_m: added to every cell's spread, so that thin
    walls pull from afar. reach_m: how far off a guess may be. structure: only what stands above the ground is matched,
    and the height is held: ground says nothing about x, y and yaw, but outnumbers what does.
    """

    cell_m: Positive
    blur_m: NotNegative
    reach_m: Positive
    structure: bool


class BesideParams(Config):
    """Poses beside a match that must explain much less than it: so far away, and turned so far to both sides.

    points: of those that stand above the ground, so many are looked at; with fewer than min_points none. A ray passes
    through what stands in the map if it comes within pierced_sigmas of it, pierced_margin_m and more from its ends.
    """

    points: Count
    min_points: Count
    away_m: Annotated[list[Positive], Field(min_length=1)]
    turned_rad: list[Positive]
    pierced_sigmas: Positive
    pierced_margin_m: Positive


class MatchParams(Config):
    """The objective and Newton's method.

    levels: coarse to fine, with falling reach; a match begins where the guess is within reach, and ends at the last.
    covariance_scale: by how much the errors found are larger than those of independent points (standard deviations);
    the sigmas are the least that a match is trusted to.
    """

    levels: Annotated[list[LevelParams], Field(min_length=1)]
    min_cell_points: Annotated[int, Field(ge=3)]
    outlier_share: Annotated[float, Field(gt=0.0, lt=1.0)]
    max_iterations: Count
    max_step_m: Positive
    max_turn_rad: Positive
    converged_m: Positive
    converged_rad: Positive
    tilt_sigma_rad: Positive
    height_sigma_m: Positive
    structure_height_m: Positive
    explained_sigmas: Positive
    covariance_scale: Positive
    position_sigma_m: Positive
    yaw_sigma_rad: Positive
    beside: BesideParams

    @model_validator(mode="after")
    def _coarse_to_fine(self) -> MatchParams:
        reach = [level.reach_m for level in self.levels]
        if reach != sorted(reach, reverse=True):
            raise ValueError("levels must be in the order of falling reach_m")
        if self.levels[-1].structure or self.levels[-1].blur_m != 0.0:
            raise ValueError("the last of levels must have all points and blur_m 0")
        return self


class EvidenceParams(Config):
    """What a match must show that explains less than min_score of the structure, because map or world have gaps.

    least_score: the share that it must explain all the same; min_agreement: of what lies where the map knows anything.
    max_pierced: the share of rays that pass through what the map has, over the agreement: what contradicts over what
    agrees. min_contrast: how many times that of the poses beside it,
    and, in a search, of every other place. max_residual: of the explained points, in variances. held_sigma_m,
    held_sigma_rad: the most in x, y and yaw: all three must be held.
    """

    least_score: Share
    min_agreement: Share
    max_pierced: Share
    min_contrast: Annotated[float, Field(gt=1.0)]
    max_residual: Positive
    held_sigma_m: Positive
    held_sigma_rad: Positive


class GateParams(Config):
    """Which matches correct the pose, and when the pose is given up.

    A match that explains sure_score of the structure needs nothing beside it; one that explains min_score must not have
    more than max_pierced of its rays pass through what the map has; one that explains less needs evidence.

    reach_sigmas: how many standard deviations of the prediction the first level of a match must reach; the yaw's count
    at reach_radius_m.
    rejected_until_lost: matches refused one after the other. accepted_until_sure: matches accepted one after the other
    before a pose found anew counts; sure_position_m, sure_yaw_rad: how little they may correct then.
    A sweep of fewer than min_structure_points says nothing, unless the map has something within expected_range_m in
    expected_directions of 36 directions, and more than max_unseen_share of them show nothing: then it contradicts.
    """

    min_score: Share
    sure_score: Share
    max_pierced: Share
    evidence: EvidenceParams
    min_structure_points: Count
    expected_range_m: Positive
    expected_directions: Count
    max_unseen_share: Share
    max_reversals: Count
    max_jump_m: Positive
    max_jump_rad: Positive
    max_sigma_m: Positive
    max_tilt_rad: Positive
    reach_sigmas: Positive
    reach_radius_m: Positive
    rejected_until_lost: Count
    accepted_until_sure: Count
    sure_position_m: Positive
    sure_yaw_rad: Positive
    frozen_sweeps: Count

    @model_validator(mode="after")
    def _ordered(self) -> GateParams:
        if not self.evidence.least_score <= self.min_score <= self.sure_score:
            raise ValueError("least_score, min_score and sure_score must rise")
        return self


class SearchParams(Config):
    """Looking for the pose when it is lost: first near the last one, then in the whole map.

    near_turn_rad: near the last pose, headings so far from the last one; every heading once the gyro was missed.
    near_ratio: a pose found among those must explain so much of what the best of the whole map explains.
    """

    near_radius_m: Positive
    near_turn_rad: Annotated[float, Field(gt=0.0, le=math.pi)]
    near_ratio: Share
    step_m: Positive
    yaw_steps: Annotated[int, Field(ge=8)]
    points: Annotated[int, Field(ge=50)]
    candidates: Annotated[int, Field(ge=2)]
    min_score: Share
    ambiguous_ratio: Share
    apart_m: Positive
    apart_rad: Positive
    position_sigma_m: Positive
    yaw_sigma_rad: Positive


class HypothesisParams(Config):
    """Several places that fit: which motion decides between.

    most: with more of them, so many things look alike that the right place may be missing. decide_way_m: nothing is
    decided before the robot has gone so far. dropped_ratio: of the best one's score, below which a place is dropped.
    idle_sweeps: without that way, after so many sweeps the map is searched anew.
    max_jump_m, max_jump_rad: a match farther from where wheels and gyro put the place is of another one. merge_m:
    places nearer than that are one.
    """

    most: Annotated[int, Field(ge=2)]
    decide_way_m: Positive
    dropped_ratio: Share
    idle_sweeps: Count
    max_jump_m: Positive
    max_jump_rad: Positive
    merge_m: Positive


class DeadReckoningParams(Config):
    """Going on by wheels and gyro where nothing stands around.

    max_way_m: since the last match that counted; then the pose is lost. least_factor: on the quality, at that way.
    """

    max_way_m: Positive
    least_factor: Share


class SlipParams(Config):
    """When the way between two matches says that the wheels slipped.

    window_s: the two are so far apart at most; a slip is told so long. least_m: ways that are less apart say nothing;
    share: of the way besides, what wheels and gyro are off without slipping; sigmas: of both matches' positions.
    """

    window_s: Positive
    least_m: Positive
    share: Share
    sigmas: Positive


class MatchQualityParams(Config):
    """What matches do to ``/localization/quality``.

    The score (explained share of the structure) counts 0 at zero_score, 1 at full_score; of a match that stands out by
    its evidence the contrast does, 0 at zero_contrast, 1 at full_contrast, if that is more. The age of the last
    accepted match counts 1 up to fresh_s, 0 from stale_s on. unsure: the most while a pose found anew is not confirmed.
    """

    zero_score: Share
    full_score: Share
    zero_contrast: Positive
    full_contrast: Positive
    fresh_s: Positive
    stale_s: Positive
    unsure: Share

    @model_validator(mode="after")
    def _ordered(self) -> MatchQualityParams:
        if self.zero_score >= self.full_score:
            raise ValueError("zero_score must be smaller than full_score")
        if self.zero_contrast >= self.full_contrast:
            raise ValueError("zero_contrast must be smaller than full_contrast")
        if self.fresh_s >= self.stale_s:
            raise ValueError("fresh_s must be smaller than stale_s")
        return self


class NdtParams(Config):
    """start_position_sigma_m, start_yaw_sigma_rad: how far off the start pose may be where there is a map."""

    start_position_sigma_m: Positive
    start_yaw_sigma_rad: Positive
    cloud: CloudParams
    match: MatchParams
    gate: GateParams
    search: SearchParams
    hypotheses: HypothesisParams
    dead_reckoning: DeadReckoningParams
    slip: SlipParams
    quality: MatchQualityParams

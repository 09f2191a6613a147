"""Parameters of matching, gates and search: section ``ndt`` of ``config/ndt_localization.yaml``."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config, Count, Fraction, NotNegative, Positive


class CloudParams(Config):
    """Selection of a sweep's points. sweep_s: longest time from a sweep's begin to its stamp."""

    voxel_m: Positive
    min_range_m: Positive
    max_range_m: Positive
    min_points: Count
    sweep_s: Positive


class LevelParams(Config):
    """One resolution of the map.

    cell_m: edge of its cells, those of the map are merged to it. blur_m: added to every cell's spread, so that thin
    walls attract from afar. reach_m: largest error of a guess. structure: only points above the ground are matched,
    and the height is held: ground does not constrain x, y and yaw, but outnumbers the points that do.
    """

    cell_m: Positive
    blur_m: NotNegative
    reach_m: Positive
    structure: bool


class BesideParams(Config):
    """Poses beside a match, at these distances and turns to both sides, that must explain much less than it.

    points: number of points above the ground to use; with fewer than min_points there is no result. A ray passes
    through a cell of the map if it comes within pierced_sigmas of it, pierced_margin_m and more from its ends.
    along_m: to both sides along the direction that the match holds worst; a match that explains less than
    along_contrast times as much as the best of these poses leaves that direction open, with a sigma of along_sigma_m.
    """

    points: Count
    min_points: Count
    away_m: Annotated[list[Positive], Field(min_length=1)]
    turned_rad: list[Positive]
    along_m: Annotated[list[Positive], Field(min_length=1)]
    along_contrast: Annotated[float, Field(gt=1.0)]
    along_sigma_m: Positive
    pierced_sigmas: Positive
    pierced_margin_m: Positive


class MatchParams(Config):
    """The objective and Newton's method.

    levels: coarse to fine, with falling reach; a match begins where the guess is within reach, and ends at the last.
    covariance_scale: ratio of the measured errors to those of independent points (standard deviations);
    the sigmas are lower bounds of a match's.
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
    """Evidence required of a match that explains little of the structure, where map or world have gaps.

    least_score: the share that it must explain all the same; min_agreement: the share in known parts of the map.
    max_pierced: the share of rays that pass through the map's structure, over the agreement. min_contrast: least ratio
    of its explained structure to that of the poses beside it and, in a search, of every other place.
    max_residual: of the explained points, in variances. held_sigma_m, held_sigma_rad: largest sigmas in x, y and yaw:
    all three must be constrained.
    """

    least_score: Fraction
    min_agreement: Fraction
    max_pierced: Fraction
    min_contrast: Annotated[float, Field(gt=1.0)]
    max_residual: Positive
    held_sigma_m: Positive
    held_sigma_rad: Positive


class GateParams(Config):
    """Which matches correct the pose, and when the pose is given up.

    A match that explains sure_score of the structure needs no further evidence. One that explains min_score is accepted
    if at most max_pierced of its rays pass through the map's structure. Any other one needs evidence.

    reach_sigmas: how many standard deviations of the prediction the first level of a match must reach; the yaw's count
    at reach_radius_m.
    rejected_until_lost: consecutive rejected matches. accepted_until_sure: consecutive accepted matches before a found
    pose counts as confirmed; sure_position_m, sure_yaw_rad: largest corrections by them.
    A sweep of fewer than min_structure_points is ignored, unless the map has structure within expected_range_m in
    expected_directions of 36, and more than max_unseen_share of them are empty in the sweep: then it contradicts.
    """

    min_score: Fraction
    sure_score: Fraction
    max_pierced: Fraction
    evidence: EvidenceParams
    min_structure_points: Count
    expected_range_m: Positive
    expected_directions: Count
    max_unseen_share: Fraction
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
    """Search for the pose when it is lost: first near the last one, then in the whole map.

    near_turn_rad: near the last pose, largest heading difference to it; all headings if the gyro had a gap.
    near_ratio: least ratio of such a pose's score to that of the best of the whole map.
    """

    near_radius_m: Positive
    near_turn_rad: Annotated[float, Field(gt=0.0, le=math.pi)]
    near_ratio: Fraction
    step_m: Positive
    yaw_steps: Annotated[int, Field(ge=8)]
    points: Annotated[int, Field(ge=50)]
    candidates: Annotated[int, Field(ge=2)]
    min_score: Fraction
    ambiguous_ratio: Fraction
    apart_m: Positive
    apart_rad: Positive
    position_sigma_m: Positive
    yaw_sigma_rad: Positive


class HypothesisParams(Config):
    """Several places that fit; motion decides between them.

    most: with more of them, so much looks alike that the right place may be missing. decide_way_m: least distance
    travelled before a decision. dropped_ratio: share of the best score below which a place is dropped.
    idle_sweeps: without that distance, the map is searched again after so many sweeps.
    max_jump_m, max_jump_rad: a match farther from the dead-reckoned place belongs to another one. merge_m:
    places nearer than that are one.
    """

    most: Annotated[int, Field(ge=2)]
    decide_way_m: Positive
    dropped_ratio: Fraction
    idle_sweeps: Count
    max_jump_m: Positive
    max_jump_rad: Positive
    merge_m: Positive


class DeadReckoningParams(Config):
    """Continuing by wheels and gyro where there is no structure.

    max_way_m: since the last counted match; then the pose is lost. least_factor: on the quality, at that distance.
    """

    max_way_m: Positive
    least_factor: Fraction


class SlipParams(Config):
    """Detection of wheel slip by the distance between two matches.

    window_s: largest time between the two; a slip is reported for as long. least_m: smaller differences are ignored;
    share: of the distance besides, the error of wheels and gyro without slip; sigmas: of both matches' positions.
    """

    window_s: Positive
    least_m: Positive
    share: Fraction
    sigmas: Positive


class MatchQualityParams(Config):
    """Effect of matches on ``/localization/quality``.

    The score (explained share of the structure) counts 0 at zero_score, 1 at full_score; for a match accepted by
    evidence the contrast counts, 0 at zero_contrast, 1 at full_contrast, if that is more. The age of the last
    accepted match counts 1 up to fresh_s, 0 from stale_s on. unsure: upper limit while a found pose is not confirmed.
    """

    zero_score: Fraction
    full_score: Fraction
    zero_contrast: Positive
    full_contrast: Positive
    fresh_s: Positive
    stale_s: Positive
    unsure: Fraction

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
    """start_position_sigma_m, start_yaw_sigma_rad: standard deviations of the start pose if there is a map."""

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

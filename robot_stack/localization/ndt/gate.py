"""Acceptance of matches, and the resulting confidence in the pose."""

from __future__ import annotations

import math
from enum import Enum

from robot_stack.core.geometry import Pose2
from robot_stack.localization.ndt.matcher import Match
from robot_stack.localization.ndt.params import EvidenceParams, GateParams, MatchQualityParams, NdtParams


class Confidence(Enum):
    """SEARCHING: the pose is unknown. CONFIRMING: the pose waits for confirming matches. TRACKING: matches hold it.

    DEAD_RECKONING: matches held it, and there is no structure nearby. AMBIGUOUS: it is one of several.
    """

    SEARCHING = "searching the map"
    AMBIGUOUS = "several poses fit: motion resolves the ambiguity"
    CONFIRMING = "confirming the pose"
    TRACKING = "tracking"
    DEAD_RECKONING = "dead reckoning: no structure to match"


def lack_of_evidence(match: Match, evidence: EvidenceParams) -> str:
    """Why a match that explains little is rejected; empty if it stands out. NaN contrast (not computed) is none."""
    if not match.score >= evidence.least_score:
        return f"less than {evidence.least_score}"
    if not match.contrast >= evidence.min_contrast:
        return f"{match.contrast:.1f} times the score of neighbouring poses, {evidence.min_contrast} are needed"
    if not match.agreement >= evidence.min_agreement:
        return f"{match.agreement:.0%} of the points in mapped space agree with the map"
    if not match.pierced <= evidence.max_pierced * match.agreement:
        return f"{match.pierced:.0%} of the rays pass through mapped obstacles"
    if not match.residual <= evidence.max_residual:
        return f"points lie {match.residual:.1f} variances off their surfaces"
    _, value_m2 = match.position_variances_m2
    if not (math.sqrt(value_m2) <= evidence.held_sigma_m):
        return f"and one direction has a sigma of {math.sqrt(value_m2):.2f} m"
    if not math.sqrt(match.planar_covariance[2, 2]) <= evidence.held_sigma_rad:
        return f"and the heading has a sigma of {math.sqrt(match.planar_covariance[2, 2]):.2f} rad"
    return ""


def fit_of(match: Match, gate: GateParams, quality: MatchQualityParams) -> float:
    """How well a match supports the pose, for the quality: 0 or less is not at all, 1 or more is fully."""
    by_score = (match.score - quality.zero_score) / (quality.full_score - quality.zero_score)
    if lack_of_evidence(match, gate.evidence):
        return by_score
    by_contrast = (match.contrast - quality.zero_contrast) / (quality.full_contrast - quality.zero_contrast)
    return max(by_score, min(1.0, by_contrast))


def problem_of(match: Match, predicted: Pose2, position_sigma_m: float, yaw_sigma_rad: float, gate: GateParams) -> str:
    """Why a match must not correct the pose; empty if it may. predicted: at the match's stamp, with its sigmas."""
    if not match.converged:
        return f"not converged after {match.iterations} iterations"
    if match.reversals > gate.max_reversals:
        return f"oscillates between two solutions: {match.reversals} reversals"
    if match.structure < gate.min_structure_points:
        return f"{match.structure} points above the ground, {gate.min_structure_points} are needed"
    doubt = _doubt(match, gate)
    if doubt:
        return doubt
    if match.tilt_rad > gate.max_tilt_rad:
        return f"tilt of {match.tilt_rad:.2f} rad"
    # A match with one unconstrained direction still constrains the other; its covariance shows which.
    sigma_m = math.sqrt(match.position_variances_m2[0])
    if not sigma_m <= gate.max_sigma_m:
        return f"sigma {sigma_m:.2f} m: the surroundings do not constrain the pose"
    jump_m, turn_rad = (
        match.planar.distance_to(predicted),
        abs(math.remainder(match.planar.yaw - predicted.yaw, math.tau)),
    )
    if jump_m > gate.max_jump_m + 3.0 * position_sigma_m:
        return f"jump of {jump_m:.2f} m"
    if turn_rad > gate.max_jump_rad + 3.0 * yaw_sigma_rad:
        return f"jump of {turn_rad:.2f} rad"
    return ""


def _doubt(match: Match, gate: GateParams) -> str:
    """What a low score leaves unproven; empty if other evidence resolves it. A NaN pierced share resolves nothing.

    Monotonic: what a match of some score needs is enough for every higher score.
    """
    if match.score >= gate.sure_score or (match.score >= gate.min_score and match.pierced <= gate.max_pierced):
        return ""
    lack = lack_of_evidence(match, gate.evidence)
    return f"score {match.score:.2f} is below {gate.sure_score}: {lack}" if lack else ""


class LocalizationState:
    """Counts consecutive accepted and rejected matches, and derives the confidence."""

    def __init__(self, params: NdtParams) -> None:
        self._gate, self._quality, self._dead_reckoning = params.gate, params.quality, params.dead_reckoning
        self.state = Confidence.CONFIRMING
        self._accepted = self._refused = 0
        self._matched_s = -math.inf  # time of the last sweep that was matched or had no structure
        self._way_m = 0.0
        self._fit = 0.0

    @property
    def known(self) -> bool:
        """True if there is one pose, confirmed or not."""
        return self.state not in (Confidence.SEARCHING, Confidence.AMBIGUOUS)

    @property
    def refused(self) -> int:
        """Matches rejected since the last accepted one."""
        return self._refused

    def restart(self, state: Confidence) -> None:
        """A pose was given or found, or is to be searched for."""
        self.state, self._accepted, self._refused, self._way_m = state, 0, 0, 0.0

    def found(self, match: Match, steady_s: float) -> None:
        """A search found a pose; it needs confirmation by matches."""
        self.restart(Confidence.CONFIRMING)
        self._fit, self._matched_s = fit_of(match, self._gate, self._quality), steady_s

    def accept(self, match: Match, correction_m: float, correction_rad: float, steady_s: float) -> None:
        gate, fit = self._gate, fit_of(match, self._gate, self._quality)
        self._fit = fit if self._accepted == 0 else self._fit + 0.3 * (fit - self._fit)
        self._matched_s, self._refused = steady_s, 0
        calm = correction_m < gate.sure_position_m and correction_rad < gate.sure_yaw_rad
        self._accepted = self._accepted + 1 if calm or self.state is Confidence.TRACKING else 0
        if self._accepted >= gate.accepted_until_sure:
            self.state = Confidence.TRACKING
        if self.state is Confidence.TRACKING:
            self._way_m = 0.0

    def nothing_around(self, steady_s: float) -> None:
        """A sweep could neither confirm nor contradict the pose, and the map expects no structure here."""
        if self.state in (Confidence.TRACKING, Confidence.DEAD_RECKONING):
            self.state, self._matched_s = Confidence.DEAD_RECKONING, steady_s

    def went(self, way_m: float) -> None:
        """The robot moved by ``way_m``."""
        self._way_m += way_m
        if self.state is Confidence.DEAD_RECKONING and self._way_m > self._dead_reckoning.max_way_m:
            self.restart(Confidence.SEARCHING)

    def unseen_motion(self) -> None:
        """The robot may have moved beyond what wheels and gyro measured, with no structure to detect it."""
        if self.state in (Confidence.DEAD_RECKONING, Confidence.AMBIGUOUS):
            self.restart(Confidence.SEARCHING)

    def refuse(self) -> None:
        """A sweep contradicted the pose."""
        self._refused += 1
        self._accepted = 0
        if self._refused >= self._gate.rejected_until_lost and self.state is not Confidence.SEARCHING:
            self.restart(Confidence.SEARCHING)

    def factor(self, steady_s: float) -> float:
        """Factor of the matches on the quality, in [0, 1]: fit and age of the last one, distance without any."""
        if not self.known:
            return 0.0
        q = self._quality
        age = (q.stale_s - (steady_s - self._matched_s)) / (q.stale_s - q.fresh_s)
        # Each consecutive contradiction reduces the factor at once; the last one makes it zero.
        agreed = 1.0 - self._refused / self._gate.rejected_until_lost
        return min(1.0, max(0.0, age)) * min(1.0, max(0.0, self._fit)) * agreed * self._by_way()

    def cap(self) -> float:
        held = self.state in (Confidence.TRACKING, Confidence.DEAD_RECKONING)
        return 1.0 if held else self._quality.unsure

    def _by_way(self) -> float:
        d = self._dead_reckoning
        if self.state is not Confidence.DEAD_RECKONING:
            return 1.0
        return 1.0 - (1.0 - d.least_factor) * min(1.0, self._way_m / d.max_way_m)

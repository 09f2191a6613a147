"""Which matches are believed, and what becomes of the confidence in the pose: searching, confirming, tracking."""

from __future__ import annotations

import math
from enum import Enum

import numpy as np

from robot_stack.core.geometry import Pose2
from robot_stack.localization.ndt.matcher import Match
from robot_stack.localization.ndt.params import GateParams, NdtParams


class Confidence(Enum):
    """SEARCHING: the pose is not known. CONFIRMING: it has to prove itself. TRACKING: matches hold it."""

    SEARCHING = "searching the map"
    CONFIRMING = "confirming the pose"
    TRACKING = "tracking"


def problem_of(match: Match, predicted: Pose2, position_sigma_m: float, yaw_sigma_rad: float, gate: GateParams) -> str:
    """Why a match must not correct the pose; empty if it may. predicted: at the match's stamp, with its sigmas."""
    if not match.converged:
        return f"not converged after {match.iterations} iterations"
    if match.reversals > gate.max_reversals:
        return f"swings between two answers: {match.reversals} reversals"
    if match.structure < gate.min_structure_points:
        return f"{match.structure} points above the ground, {gate.min_structure_points} are needed"
    if match.score < gate.min_score:
        return f"score {match.score:.2f} is below {gate.min_score}"
    if match.tilt_rad > gate.max_tilt_rad:
        return f"tilt of {match.tilt_rad:.2f} rad"
    # A match that leaves one direction open still says something about the other; its covariance tells which.
    sigma_m = math.sqrt(float(np.linalg.eigvalsh(match.planar_covariance[:2, :2])[0]))
    if not sigma_m <= gate.max_sigma_m:
        return f"sigma {sigma_m:.2f} m: the surroundings do not hold the pose"
    jump_m, turn_rad = (
        match.planar.distance_to(predicted),
        abs(math.remainder(match.planar.yaw - predicted.yaw, math.tau)),
    )
    if jump_m > gate.max_jump_m + 3.0 * position_sigma_m:
        return f"jump of {jump_m:.2f} m"
    if turn_rad > gate.max_jump_rad + 3.0 * yaw_sigma_rad:
        return f"jump of {turn_rad:.2f} rad"
    return ""


class LocalizationState:
    """Counts matches accepted and refused one after the other, and what follows from them."""

    def __init__(self, params: NdtParams) -> None:
        self._gate, self._quality = params.gate, params.quality
        self.state = Confidence.CONFIRMING
        self._accepted = self._refused = 0
        self._accepted_s = -math.inf
        self._score = 0.0

    @property
    def refused(self) -> int:
        """Matches refused since the last accepted one."""
        return self._refused

    def restart(self, state: Confidence) -> None:
        """The pose was given or found anew, or is to be looked for."""
        self.state, self._accepted, self._refused = state, 0, 0

    def found(self, score: float, steady_s: float) -> None:
        """A search came up with a pose; it has to prove itself from now on."""
        self.restart(Confidence.CONFIRMING)
        self._score, self._accepted_s = score, steady_s

    def accept(self, score: float, correction_m: float, correction_rad: float, steady_s: float) -> None:
        gate = self._gate
        self._score = score if self._accepted == 0 else self._score + 0.3 * (score - self._score)
        self._accepted_s, self._refused = steady_s, 0
        calm = correction_m < gate.sure_position_m and correction_rad < gate.sure_yaw_rad
        self._accepted = self._accepted + 1 if calm or self.state is Confidence.TRACKING else 0
        if self._accepted >= gate.accepted_until_sure:
            self.state = Confidence.TRACKING

    def refuse(self) -> None:
        """A sweep contradicted the pose."""
        self._refused += 1
        self._accepted = 0
        if self._refused >= self._gate.rejected_until_lost and self.state is not Confidence.SEARCHING:
            self.restart(Confidence.SEARCHING)

    def factor(self, steady_s: float) -> float:
        """By how much the matches lower the quality, in [0, 1]: score and age of the last accepted one."""
        if self.state is Confidence.SEARCHING:
            return 0.0
        q = self._quality
        age = (q.stale_s - (steady_s - self._accepted_s)) / (q.stale_s - q.fresh_s)
        score = (self._score - q.zero_score) / (q.full_score - q.zero_score)
        # Each contradiction in a row counts at once; the last would make it zero.
        agreed = 1.0 - self._refused / self._gate.rejected_until_lost
        return min(1.0, max(0.0, age)) * min(1.0, max(0.0, score)) * agreed

    def cap(self) -> float:
        return 1.0 if self.state is Confidence.TRACKING else self._quality.unsure

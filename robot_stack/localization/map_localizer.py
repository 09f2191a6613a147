"""Localization against a map: matches of LiDAR sweeps correct the filter of odometry and gyro at their stamp.

A match takes milliseconds, a search seconds: ``request`` returns the computation to run anywhere, and ``answer``
processes its result.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.core.levels import Levels
from robot_stack.core.point_cloud import Points
from robot_stack.localization.filter import Array
from robot_stack.localization.history import NO_DOUBT, Correction
from robot_stack.localization.localizer import Estimate, Localizer
from robot_stack.localization.ndt.gate import Confidence, LocalizationState, problem_of
from robot_stack.localization.ndt.hypotheses import Hypotheses
from robot_stack.localization.ndt.matcher import Match, NdtMatcher, pose_of
from robot_stack.localization.ndt.search import Region
from robot_stack.localization.ndt.slip import Slip, SlipWitness
from robot_stack.localization.ndt.solver import MatchRequest, MatchResult
from robot_stack.localization.odometry import OdometryEvent, OdometryReading, Variances
from robot_stack.localization.params import LocalizationParams

_KNOT_S = 0.01
# Added to the covariance after a rejected match, m2 and rad2: consistent matches are then accepted again.
_DOUBT = (0.03**2, 0.03**2, 0.01**2)
_FINGERPRINT_POINTS = 64
# Covariance of an unknown pose, m2 and rad2.
_UNKNOWN = np.diag([1e6, 1e6, math.pi**2])


class MapLocalizer(Localizer):
    """A localizer with a map. levels: a search stays on that of the last pose. See :class:`Localizer` for the rest."""

    def __init__(
        self,
        params: LocalizationParams,
        max_speed_mps: float,
        max_yaw_rate_radps: float,
        matcher: NdtMatcher,
        levels: Levels | None = None,
    ) -> None:
        self._ndt, self._levels = params.ndt, levels or Levels()
        super().__init__(params, max_speed_mps, max_yaw_rate_radps)
        self._matcher = matcher
        self._localization = LocalizationState(params.ndt)
        self._up = np.array([0.0, 0.0, 1.0])
        self._z_m = math.nan
        self._sweep: tuple[float, Points] | None = None
        self._fingerprint = b""
        self._repeats = 0
        self._epoch = 0
        self._searched_near = False
        self._heading_kept = False  # from matches or an operator, then held by the gyro without a gap
        self._hypotheses: Hypotheses | None = None
        self._asked_s = -math.inf
        self._witness = SlipWitness(params.ndt.slip)
        self.slip: Slip | None = None  # up to the last match that was no outlier
        self._problem = ""
        self.match: Match | None = None

    @property
    def confidence(self) -> Confidence:
        return self._localization.state

    def start_covariance(self) -> Array:
        position, yaw = self._ndt.start_position_sigma_m**2, self._ndt.start_yaw_sigma_rad**2
        return np.diag([position, position, yaw])

    def on_up(self, up: Array) -> None:
        """up: (3,) the vertical in base_link as measured by the IMU; ignored if it is not a unit vector."""
        if np.isfinite(up).all() and abs(float(up @ up) - 1.0) < 0.01 and up[2] > 0.0:
            self._up = up

    def on_odometry(self, reading: OdometryReading, received_s: float) -> OdometryEvent:
        before = self.travelled.newest
        event = super().on_odometry(reading, received_s)
        if event in (OdometryEvent.RESTARTED, OdometryEvent.CLOCK_RESTARTED):
            self._sweep, self._asked_s = None, -math.inf
            self._epoch += 1
            self._localization.unseen_motion()
            self._heading_kept = False
            self._forget_slip()
        elif event is OdometryEvent.MOTION and before is not None and self.travelled.newest is not None:
            self._localization.went(self.travelled.newest.pose.distance_to(before.pose))
            self._heading_kept = self._heading_kept and self._gyro_used
            if self.slip and reading.stamp_s - self.slip.stamp_s > self._ndt.slip.window_s:
                self.slip = None  # no match since: unknown whether it continues
        return event

    def on_sweep(self, sweep: Points, stamp_s: float) -> None:
        """sweep: SWEEP, sensor frame, at stamp_s. The newest one waits until odometry reaches its stamp."""
        few = sweep[:: max(1, len(sweep) // _FINGERPRINT_POINTS)]  # by fields: padding is undefined
        fingerprint = b"".join(few[name].tobytes() for name in ("x", "y", "z", "intensity"))
        if len(sweep) and fingerprint == self._fingerprint:
            self._repeats += 1  # a working sensor never repeats itself: not new data
            return
        self._fingerprint, self._repeats = fingerprint, 0
        if math.isfinite(stamp_s):
            self._sweep = (stamp_s, sweep)

    def request(self) -> MatchRequest | None:
        """The next match to compute, if any; each sweep is requested once."""
        if self._sweep is None:
            return None
        stamp_s, sweep = self._sweep
        newest = self.travelled.newest
        if newest is None or newest.stamp_s < stamp_s:
            return None  # odometry has not reached its stamp yet
        self._sweep = None
        travelled = self.travelled.at(stamp_s)
        if travelled is None or stamp_s <= self._asked_s:
            self._problem = "sweep is older than the odometry history"
            return None
        self._asked_s = stamp_s
        state = self._filter.state()
        predicted = state.pose.compose(travelled.relative_to(newest.pose))
        z_m = self._z_m if math.isfinite(self._z_m) else self._matcher.ground_m(predicted.x, predicted.y)
        gate = self._ndt.gate
        off_m = gate.reach_sigmas * (state.position_sigma_m + gate.reach_radius_m * state.yaw_sigma_rad)
        guess = pose_of(predicted, z_m if math.isfinite(z_m) else 0.0, self._up)
        motion = self._motion(stamp_s, travelled)
        region: Region | None = None
        guesses: tuple[Array, ...] = ()
        if self._localization.state is Confidence.SEARCHING:
            region = self._region(predicted)
        elif self._localization.state is Confidence.AMBIGUOUS:
            off_m, guesses = self._ndt.hypotheses.max_jump_m, self._places(travelled)
        return MatchRequest(stamp_s, sweep, motion, guess, self._up, off_m, region, travelled, self._epoch, guesses)

    def answer(self, answer: MatchResult, steady_s: float) -> None:
        """Processes the result of an earlier request. steady_s: the steady clock now."""
        request = answer.request
        if request.epoch != self._epoch:
            return
        searched = self._localization.state is Confidence.SEARCHING
        compared = self._localization.state is Confidence.AMBIGUOUS
        if searched != (request.region is not None) or compared != bool(request.guesses):
            return  # requested before the pose was lost
        if answer.match is None:
            self._problem = answer.problem
            self._searched_near = searched
            if searched:
                self._take_places(request, answer.rivals)
            elif answer.rivals:
                self._compare(request, answer.rivals, steady_s)
            return
        self.match = answer.match
        if searched:
            self._relocalize(request, answer.match, steady_s)
        else:
            self._judge(answer, answer.match, steady_s)

    def reset(self, pose: Pose2, covariance: Array, stamp_s: float) -> None:
        super().reset(pose, covariance, stamp_s)
        self._epoch += 1
        self._z_m = math.nan
        self._searched_near, self._heading_kept = False, True
        self._forget_slip()
        self._localization.restart(Confidence.CONFIRMING)

    def estimate(self, steady_s: float) -> Estimate:
        estimate = super().estimate(steady_s)
        value = min(estimate.quality * self._localization.factor(steady_s), self._localization.cap())
        covariance = estimate.covariance if self._localization.known else _UNKNOWN
        slipped_m = self.slip.off_m(estimate.stamp_s) if self.slip else 0.0
        return replace(
            estimate,
            quality=value,
            covariance=covariance + np.diag([slipped_m**2, slipped_m**2, 0.0]),
            position_sigma_m=math.hypot(estimate.position_sigma_m, slipped_m),
            faults=(*estimate.faults, *self._map_faults()),
        )

    def _take_places(self, request: MatchRequest, rivals: tuple[Match, ...]) -> None:
        """If a search of the whole map found several places, motion decides between them."""
        whole_map = request.region is not None and math.isinf(request.region.radius_m)
        if whole_map and 1 < len(rivals) <= self._ndt.hypotheses.most:
            self._hypotheses = Hypotheses(rivals, request.travelled, self._ndt.hypotheses)
            self._localization.restart(Confidence.AMBIGUOUS)

    def _places(self, travelled: Pose2) -> tuple[Array, ...]:
        """(4, 4) each: the robot's pose by each hypothesis."""
        assert self._hypotheses is not None
        heights = ((pose, self._matcher.ground_m(pose.x, pose.y)) for pose in self._hypotheses.guesses(travelled))
        return tuple(pose_of(pose, z_m if math.isfinite(z_m) else 0.0, self._up) for pose, z_m in heights)

    def _compare(self, request: MatchRequest, rivals: tuple[Match, ...], steady_s: float) -> None:
        """Scores each hypothesis by a sweep; the last one left becomes the pose, to be confirmed by matches."""
        if self._hypotheses is None or len(self._hypotheses) != len(rivals):
            return  # requested for other hypotheses
        self._hypotheses.judge(rivals, request.travelled)
        alone = self._hypotheses.alone()
        if self._hypotheses.best_score() < self._ndt.search.min_score or self._hypotheses.idle():
            self._localization.restart(Confidence.SEARCHING)
            self._searched_near = True  # there is no last pose to search near
        elif alone is not None:
            self.match = alone
            self._relocalize(request, alone, steady_s)

    def _relocalize(self, request: MatchRequest, match: Match, steady_s: float) -> None:
        """Restarts the filter from the pose found by a search."""
        search = self._ndt.search
        sigmas = [search.position_sigma_m, search.position_sigma_m, search.yaw_sigma_rad]
        newest = self.travelled.newest
        since = IDENTITY if newest is None else newest.pose.relative_to(request.travelled)
        self._pose_filter.set_pose(match.planar.compose(since), np.diag(np.square(sigmas)))
        if not math.isnan(self._filter.stamp_s):
            self._filter.start(self._filter.stamp_s)
        self._z_m = float(match.pose[2, 3])
        # A pose from a search is supported only by its fit: if it proves wrong, so may its heading.
        self._searched_near, self._heading_kept, self._problem = False, False, ""
        self._forget_slip()
        self._localization.found(match, steady_s)

    def _judge(self, answer: MatchResult, match: Match, steady_s: float) -> None:
        """Applies the match of a sweep with structure. One without is ignored unless the map has structure here."""
        gate = self._ndt.gate
        if match.structure >= gate.min_structure_points:
            self._apply_match(answer.request, match, steady_s)
        elif answer.unseen > gate.max_unseen_share:
            self._problem = f"{answer.unseen:.0%} of the directions lack the returns that the map predicts"
            self._localization.refuse()
        else:
            self._problem = f"{match.structure} points above the ground, {gate.min_structure_points} are needed"
            self._localization.nothing_around(steady_s)

    def _apply_match(self, request: MatchRequest, match: Match, steady_s: float) -> None:
        """Corrects by a match that passes every gate."""
        newest, state = self.travelled.newest, self._filter.state()
        moved = IDENTITY if newest is None else request.travelled.relative_to(newest.pose)
        predicted = state.pose.compose(moved)
        problem = problem_of(match, predicted, state.position_sigma_m, state.yaw_sigma_rad, self._ndt.gate)
        if not problem:
            self.slip = self._witness.see(request.stamp_s, match, request.travelled)
            doubt = self._slipped(match, predicted) if self.slip else NO_DOUBT
            result = self.correct(match.planar, match.planar_covariance, request.stamp_s, doubt)
            if result in (Correction.TOO_OLD, Correction.TOO_NEW):
                self._problem = f"match came too late: {result.value}"
                return
            if result is not Correction.APPLIED:
                problem = f"match refused: {result.value}"
                self._inflate_covariance()
        self._problem = problem
        if problem:
            self._localization.refuse()
            return
        self._z_m = float(match.pose[2, 3])
        turn_rad = abs(math.remainder(match.planar.yaw - predicted.yaw, math.tau))
        self._localization.accept(match, match.planar.distance_to(predicted), turn_rad, steady_s)
        self._heading_kept = self._heading_kept or self._localization.state is Confidence.TRACKING

    def _slipped(self, match: Match, predicted: Pose2) -> Variances:
        """The error of a match as variance for the filter to follow it at once: while the wheels slip."""
        off_m2 = match.planar.distance_to(predicted) ** 2
        return off_m2, off_m2, 0.0  # the heading is the gyro's

    def _forget_slip(self) -> None:
        self._witness.clear()
        self.slip = None

    def _inflate_covariance(self) -> None:
        # A good match outside the gate: the wheels may have slid farther than odometry measures.
        self._pose_filter.grow(_DOUBT)
        self._filter.start(self._filter.stamp_s)

    def _region(self, predicted: Pose2) -> Region:
        search, area = self._ndt.search, self._levels.area_at(predicted)
        if self._searched_near:
            return Region(predicted.x, predicted.y, math.inf, area=area)
        known = self._heading_kept and 3.0 * self._filter.state().yaw_sigma_rad < search.near_turn_rad
        turn_rad = search.near_turn_rad if known else math.pi
        return Region(predicted.x, predicted.y, search.near_radius_m, predicted.yaw, turn_rad, area)

    def _motion(self, stamp_s: float, at_stamp: Pose2) -> Array:
        """(k, 4) rows of time, x, y, yaw: base_link during the sweep, in base_link at its stamp."""
        count = round(self._ndt.cloud.sweep_s / _KNOT_S)
        rows = []
        for k in range(-count, 1):
            pose = self.travelled.at(stamp_s + k * _KNOT_S) if k else at_stamp
            if pose is not None:
                step = pose.relative_to(at_stamp)
                rows.append((k * _KNOT_S, step.x, step.y, step.yaw))
        return np.array(rows)

    def _map_faults(self) -> tuple[str, ...]:
        faults = [self._problem, "wheels slip: map and wheels disagree on the motion" if self.slip else ""]
        if self._localization.state is not Confidence.TRACKING:
            faults.append(self._localization.state.value)
        if self._repeats >= self._ndt.gate.frozen_sweeps:
            faults.append(f"/sensors/lidar/points frozen: {self._repeats} equal sweeps")
        return tuple(fault for fault in faults if fault)

"""Matches of low score: required evidence, contradictions, and real sweeps of a place that was not used for tuning."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from robot_stack.core.point_cloud import Points
from robot_stack.localization.map_localizer import MapLocalizer
from robot_stack.localization.ndt.gate import Confidence, fit_of, lack_of_evidence, problem_of
from robot_stack.localization.ndt.matcher import Match, pose_of
from robot_stack.localization.ndt.solver import MatchRequest, SweepSolver
from tests.benchmarks.support.ndt_foreign import GONE, Place, in_another_world, places, searched, tracked, without
from tests.unit.localization.courtyard import (
    LIDAR,
    UP,
    cells,
    corridor_solver,
    corridor_with_posts,
    matcher,
    seen_from,
    solver,
    surfaces,
    sweep_from,
)
from tests.unit.localization.stories import IMU_S, params, reading

KITTI = Path("/work/shared/data/lidar")
HERE = Pose2(1.0, 2.0, 0.4)
needs_sweeps = pytest.mark.skipif(len(list(KITTI.glob("scan_*.bin"))) < 2, reason="no real sweeps beside the project")


def found(score: float, **evidence: float) -> Match:
    """Returns a match for the gate. By default its evidence is that of a correct match of the real sweeps."""
    values = {"residual": 1.0, "agreement": 0.6, "contrast": 4.0, "pierced": 0.05, **evidence}
    return Match(pose_of(HERE, 0.0, UP), 1e-4 * np.eye(6), score, 3000, True, 5, 0, **values)


def problem(match: Match) -> str:
    return problem_of(match, HERE, 0.01, 0.001, params().ndt.gate)


@pytest.mark.parametrize(
    ("changed", "word"),
    [
        ({"contrast": 1.5}, "neighbouring"),
        ({"agreement": 0.4}, "mapped space"),
        ({"pierced": 0.15}, "pass through"),
        ({"residual": 2.0}, "variances"),
        ({"contrast": math.nan}, "neighbouring"),
        ({"agreement": math.nan}, "mapped space"),
        ({"residual": math.nan}, "variances"),
    ],
)
def test_missing_evidence_is_reported_by_criterion(changed: dict[str, float], word: str) -> None:
    assert problem(found(0.3)) == ""
    assert word in problem(found(0.3, **changed))


@pytest.mark.parametrize("axis", [0, 1, 5])
def test_a_match_of_low_score_must_hold_the_pose_in_every_direction(axis: int) -> None:
    match = found(0.3)
    open_along = match.covariance.copy()
    open_along[axis, axis] = 0.25
    assert "has a sigma of" in problem(replace(match, covariance=open_along))


def test_next_to_nothing_explained_is_never_enough() -> None:
    assert "less than" in problem(found(0.1, contrast=50.0, pierced=0.0, agreement=0.9))


def test_more_than_half_explained_is_refused_if_the_rays_pass_through_the_map() -> None:
    assert problem(found(0.6, contrast=1.0)) == ""
    assert "pass through" in problem(found(0.6, pierced=0.3))
    assert "pass through" in problem(found(0.6, pierced=math.nan))
    assert problem(found(0.9, pierced=math.nan)) == ""


SHARE = st.floats(0.0, 1.0)


@example(0.5, 0.6, 4.0, 0.9, 0.15, 1.0)
@given(SHARE, SHARE, st.floats(0.5, 6.0), SHARE, st.floats(0.0, 0.5), st.floats(0.5, 2.0))
def test_a_higher_score_needs_no_more_evidence(
    low: float, high: float, contrast: float, agreement: float, pierced: float, residual: float
) -> None:
    low, high = sorted((low, high))
    evidence = {"contrast": contrast, "agreement": agreement, "pierced": pierced, "residual": residual}
    assert problem(found(low, **evidence)) or not problem(found(high, **evidence))


def test_match_accepted_by_gate_has_driving_quality() -> None:
    ndt = params().ndt
    least = found(ndt.gate.evidence.least_score, contrast=ndt.gate.evidence.min_contrast)
    assert lack_of_evidence(least, ndt.gate.evidence) == ""
    assert fit_of(least, ndt.gate, ndt.quality) > 0.5
    assert fit_of(found(ndt.gate.min_score), ndt.gate, ndt.quality) > 0.5
    assert fit_of(found(0.3, pierced=0.5), ndt.gate, ndt.quality) <= 0.0


def test_rays_pass_through_the_map_at_a_wrong_place_and_not_at_the_right_one() -> None:
    lidar = np.array(LIDAR)
    points = seen_from(pose_of(HERE, 0.02, UP), surfaces(8.0, seed=7))
    right = matcher().match(points, pose_of(HERE, 0.0, UP), UP, 0.1)
    right = matcher().weighed(points, right, lidar)
    wrong = replace(right, pose=pose_of(HERE.compose(Pose2(-5.0, -3.0, 0.8)), 0.0, UP))
    wrong = matcher().weighed(points, wrong, lidar)
    assert right.pierced < 0.12
    assert wrong.pierced > 2.0 * right.pierced
    assert right.contrast > 1.5
    assert wrong.contrast < right.contrast
    assert right.residual < 1.0
    assert right.agreement > 0.9


def test_a_row_of_posts_leaves_the_pose_open_along_it() -> None:
    """The match alone claims to hold it, at whichever posts."""
    here, lidar = pose_of(Pose2(9.0, 0.2, 0.25), 0.02, UP), np.array(LIDAR)
    posts = corridor_solver().matcher
    points = seen_from(here, corridor_with_posts(8.0, seed=7))
    match = posts.match(points, here, UP, 0.1)
    weighed = posts.weighed(points, match, lidar)
    assert math.sqrt(match.position_variances_m2[1]) < 0.1
    assert math.sqrt(weighed.position_variances_m2[1]) > 1.0
    assert weighed.position_variances_m2[0] == pytest.approx(match.position_variances_m2[0], rel=0.1), "not across"
    points = seen_from(pose_of(HERE, 0.02, UP), surfaces(8.0, seed=7))
    match = matcher().match(points, pose_of(HERE, 0.0, UP), UP, 0.1)
    assert np.array_equal(matcher().weighed(points, match, lidar).covariance, match.covariance)


def test_too_few_points_weigh_nothing() -> None:
    bare = matcher().match(np.zeros((5, 3)), np.eye(4), UP, 0.1)
    assert math.isnan(matcher().weighed(np.zeros((5, 3)), bare, np.array(LIDAR)).contrast)


def test_solver_computes_contrast_only_below_sure_score() -> None:
    request = MatchRequest(0.0, sweep_from(HERE), np.zeros((1, 4)), pose_of(HERE, 0.0, UP), UP, 0.2, None, IDENTITY, 0)
    sure = solver().solve(request).match
    assert sure.score > params().ndt.gate.sure_score
    assert math.isnan(sure.contrast)
    holes = without(cells(), 0.4, True, params().ndt, np.random.default_rng(4))
    open_question = SweepSolver(holes, params().ndt, LIDAR).solve(request).match
    assert open_question.score < params().ndt.gate.sure_score
    assert math.isfinite(open_question.contrast)


@cache
def street() -> tuple[Place, ...]:
    return tuple(places(KITTI)[0])


@needs_sweeps
@pytest.mark.parametrize("gone", GONE)
def test_real_sweeps_are_accepted_where_they_are_and_nowhere_else(gone: float) -> None:
    ndt, random = params().ndt, np.random.default_rng(500 + round(100 * gone))
    for place in street():
        right, wrong = tracked(place, ndt, gone, maps=3, starts=3, random=random)
        assert right.wrong == wrong.wrong == 0
        assert len(right.refused) <= (3 if gone > 0.3 else 0)  # of nine: at most all starts in one of three maps
        assert all(metres < 0.03 for metres, _ in right.errors)
        assert right.errors


@needs_sweeps
def test_real_sweeps_are_found_in_their_map_and_not_in_the_courtyard() -> None:
    ndt, random = params().ndt, np.random.default_rng(510)
    for place in street():
        looked = searched(place, ndt, 0.2, 1, random)
        assert looked.wrong == 0
        assert len(looked.errors) == 1
    matches, searches = in_another_world(cells(), street(), ndt, 6, random)
    assert matches.wrong == searches.wrong == 0


class Car:
    """A car at rest at the true pose. Every sweep is the same real one with another intensity."""

    def __init__(self, site: Place, start: Pose2) -> None:
        own = params(start_x_m=start.x, start_y_m=start.y, start_yaw_rad=start.yaw)
        self.site, self.solver = site, SweepSolver(site.cells, own.ndt, site.lidar)
        self.localizer, self.t_s = MapLocalizer(own, 1.5, 1.0, self.solver.matcher), 100.0

    def stand(self, sweeps: int) -> Car:
        for count in range(sweeps):
            for step in range(10):
                self.t_s += IMU_S
                if step % 2:
                    self.localizer.on_odometry(reading(self.t_s, IDENTITY, Twist2(0.0, 0.0, 0.0)), self.t_s)
            self.localizer.on_sweep(self._sweep(count), self.t_s)
            request = self.localizer.request()
            if request is not None:
                self.localizer.answer(self.solver.solve(request), self.t_s)
        return self

    def _sweep(self, count: int) -> Points:
        sweep = self.site.sweep.copy()
        sweep["intensity"] = count
        return sweep

    @property
    def quality(self) -> float:
        return self.localizer.estimate(self.t_s).quality


@needs_sweeps
def test_street_localization_converges_to_tracking() -> None:
    site = street()[0]
    car = Car(site, site.truth.compose(Pose2(0.25, -0.2, 0.02))).stand(15)
    assert car.localizer.confidence is Confidence.TRACKING
    pose = car.localizer.estimate(car.t_s).pose
    assert pose.distance_to(site.truth) < 0.03
    assert car.quality > 0.5


@needs_sweeps
def test_street_localization_rejects_wrong_initial_pose() -> None:
    site = street()[0]
    car = Car(site, site.truth.compose(Pose2(-9.0, 1.0, 0.0)))
    for _ in range(12):
        car.stand(1)
        pose = car.localizer.estimate(car.t_s).pose
        assert car.quality < 0.3 or pose.distance_to(site.truth) < 0.05

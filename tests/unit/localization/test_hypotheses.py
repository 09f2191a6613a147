"""Several matching places, by hand: what removes one, what does not, and when one remains."""

from __future__ import annotations

import numpy as np

from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.localization.ndt.hypotheses import Hypotheses
from robot_stack.localization.ndt.matcher import Match, pose_of
from tests.unit.localization.courtyard import UP
from tests.unit.localization.stories import params

HERE, THERE = Pose2(0.0, 0.0, 0.0), Pose2(50.0, 0.0, 1.0)


def match(pose: Pose2, score: float = 0.9, converged: bool = True) -> Match:
    return Match(pose_of(pose, 0.0, UP), np.eye(6), score, 500, converged, 5, 0)


def two() -> Hypotheses:
    return Hypotheses([match(HERE), match(THERE)], IDENTITY, params().ndt.hypotheses)


def went(places: Hypotheses, way_m: float, scores: tuple[float, float]) -> None:
    """Moves by way_m and judges one sweep. Each place is matched where wheels and gyro predict it."""
    travelled = Pose2(way_m, 0.0, 0.0)
    guesses = places.guesses(travelled)
    places.judge([match(pose, score) for pose, score in zip(guesses, scores, strict=False)], travelled)


def test_places_go_on_by_wheels_and_gyro() -> None:
    here, there = two().guesses(Pose2(2.0, 0.0, 0.5))
    assert here == Pose2(2.0, 0.0, 0.5)
    assert there.distance_to(THERE.compose(Pose2(2.0, 0.0, 0.5))) < 1e-9


def test_nothing_is_decided_before_the_robot_has_moved() -> None:
    places = two()
    for _ in range(50):
        went(places, 0.0, (0.9, 0.2))
    assert len(places) == 2
    assert places.alone() is None
    assert places.idle()
    went(places, 1.0, (0.9, 0.9))
    assert not places.idle()


def test_hypothesis_with_clearly_lower_score_is_dropped() -> None:
    places = two()
    for step in range(1, 15):
        if len(places) == 2:
            went(places, 0.2 * step, (0.9, 0.5))
    alone = places.alone()
    assert alone.planar.distance_to(HERE) < 5.0
    places = two()
    for step in range(1, 50):
        went(places, 0.2 * step, (0.9, 0.8))
    assert len(places) == 2, "a similar score keeps both"


def test_a_match_that_jumps_or_does_not_converge_holds_no_place() -> None:
    for wrong in (match(Pose2(53.0, 0.0, 1.0), 0.95), match(THERE, 0.95, converged=False)):
        places = two()
        for step in range(1, 15):
            if len(places) == 2:
                travelled = Pose2(0.2 * step, 0.0, 0.0)
                places.judge([match(places.guesses(travelled)[0]), wrong], travelled)
        alone = places.alone()
        assert alone.planar.distance_to(HERE) < 5.0


def test_places_that_meet_are_one() -> None:
    places = Hypotheses([match(HERE), match(Pose2(1.2, 0.0, 0.0))], IDENTITY, params().ndt.hypotheses)
    places.judge([match(Pose2(0.45, 0.0, 0.0)), match(Pose2(0.8, 0.0, 0.0), 0.8)], IDENTITY)
    assert len(places) == 1


def test_a_place_that_the_newest_sweep_does_not_hold_is_not_given_out() -> None:
    places = Hypotheses([match(HERE)], IDENTITY, params().ndt.hypotheses)
    places.judge([match(HERE, converged=False)], IDENTITY)
    assert places.alone() is None


def test_the_same_place_faced_the_other_way_is_another_place() -> None:
    mirror = Pose2(0.1, 0.0, np.pi)
    places = Hypotheses([match(HERE), match(mirror, 0.85)], IDENTITY, params().ndt.hypotheses)
    went(places, 0.0, (0.9, 0.85))
    assert len(places) == 2
    beside = Hypotheses([match(HERE), match(Pose2(0.1, 0.0, 0.0), 0.85)], IDENTITY, params().ndt.hypotheses)
    went(beside, 0.0, (0.9, 0.85))
    assert len(beside) == 1

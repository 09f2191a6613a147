"""Poses over time, and the moments shown in a film."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.core.geometry import Pose2
from robot_stack.film.captions import caption
from robot_stack.film.tracks import Track, carried, moments, newest

AHEAD = Pose2(0.95, 0.0, 0.0)


def test_between_samples_it_moves_evenly_and_turns_the_short_way() -> None:
    track = Track([(12.0, Pose2(4.0, 2.0, -3.0)), (10.0, Pose2(0.0, 0.0, 3.0))])  # in any order
    assert track.line(11.0).tolist() == [[0.0, 0.0]]
    middle = track.at(11.0)
    assert (middle.x, middle.y) == pytest.approx((2.0, 1.0))
    assert abs(middle.yaw) == pytest.approx(math.pi)
    assert track.at(0.0) == pytest.approx(Pose2(0.0, 0.0, 3.0))
    assert track.at(99.0) == pytest.approx(Pose2(4.0, 2.0, -3.0))


def test_a_track_without_samples_is_refused() -> None:
    with pytest.raises(ValueError, match="needs a pose"):
        Track([])


def test_newest_is_the_last_that_is_not_later() -> None:
    items = [(1.0, "a"), (2.0, "b")]
    assert [newest(items, at_s, "-") for at_s in (0.5, 1.0, 1.9, 2.0, 9.0)] == ["-", "a", "a", "b", "b"]


def test_a_film_gives_standing_little_time() -> None:
    """10 m in 10 s, then 30 s of standing, which count as 3.6 m at 0.12 m/s: a quarter of the frames."""
    track = Track([(0.0, Pose2(0.0, 0.0, 0.0)), (10.0, Pose2(10.0, 0.0, 0.0)), (40.0, Pose2(10.0, 0.0, 0.0))])
    times = moments(track, 1001, standing_mps=0.12, turning_m=0.4)
    assert (times[0], times[-1]) == (0.0, 40.0)
    assert np.all(np.diff(times) > 0.0)
    assert np.mean(times > 10.0) == pytest.approx(3.6 / (10.0 + 1.2 + 3.6), abs=0.01)


def test_a_film_shows_turning_on_the_spot() -> None:
    track = Track([(0.0, Pose2(0.0, 0.0, 0.0)), (5.0, Pose2(0.0, 0.0, 3.0)), (10.0, Pose2(0.0, 0.0, 3.0))])
    times = moments(track, 101, standing_mps=0.12, turning_m=0.4)
    assert np.mean(times < 5.0) > 0.6


def test_a_carried_wheelchair_stands_before_and_after() -> None:
    """Its pose follows from the latch: where the latch closed, then ahead of the robot, then where the latch opened."""
    robot = Track([(float(t), Pose2(float(t), 0.0, 0.0)) for t in range(11)])
    chair = carried(robot, [(0.0, False), (3.0, True), (7.0, False)], AHEAD)
    assert [chair.at(t).x for t in (0.0, 3.0, 5.0, 7.0, 10.0)] == pytest.approx([3.95, 3.95, 5.95, 7.95, 7.95])
    kept = carried(robot, [(3.0, True)], AHEAD)
    assert kept.at(10.0).x == pytest.approx(10.95)
    assert carried(robot, [(0.0, False)], AHEAD) is None


@pytest.mark.parametrize(
    ("status", "text"),
    [
        (("RUNNING", "gate", "IDLE", False), "driving to: gate"),
        (("RUNNING", "gate", "DOCKED", True), "carrying the passenger to: gate"),
        (("RUNNING", "", "IDLE", False), "driving"),
        (("RUNNING", "pick-up", "FINE_ALIGN", False), "docking, the last centimetres"),
        (("RUNNING", "destination", "SERVOING", True), "putting the wheelchair down"),
        (("PAUSED", "gate", "SERVOING", False), "paused"),
    ],
)
def test_captions(status: tuple[str, str, str, bool], text: str) -> None:
    assert caption(*status) == text

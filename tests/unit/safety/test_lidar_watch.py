"""A valid sweep and invalid ones: a covered lens, a frozen sensor."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_stack.safety.lidar_watch import LidarWatch
from robot_stack.safety.obstacle_params import LidarParams
from tests.unit.safety.story import PARAMS

LIMITS = PARAMS.lidar.model_copy(
    update={"min_range_m": 0.5, "max_range_m": 60.0, "min_returns": 1000, "sectors": 10, "min_sector_share": 0.7}
)
Point = tuple[float, float, float]


def ring(*sectors: int, radius_m: float = 8.0) -> list[Point]:
    """Returns a point in the middle of each sector, counted counterclockwise from behind."""
    bearings = [2.0 * math.pi * ((sector + 0.5) / LIMITS.sectors - 0.5) for sector in sectors]
    return [(radius_m * math.cos(bearing), radius_m * math.sin(bearing), 0.0) for bearing in bearings]


def sweep(*points: Point) -> NDArray[np.float32]:
    return np.array(points, np.float32).reshape(-1, 3)


def problem(*points: Point, of: int = 1000, limits: LidarParams = LIMITS) -> str:
    watch = LidarWatch(limits)
    watch.received(sweep(*points), of, 1.0)
    assert watch.age_s(1.5) == (math.inf if watch.problem else 0.5)
    return watch.problem


WHOLE = ring(*range(10))


def test_never_received() -> None:
    watch = LidarWatch(LIMITS)
    assert (watch.problem, watch.age_s(1.0)) == ("never received", math.inf)


@pytest.mark.parametrize(("of", "expected"), [(1000, ""), (999, "covered: 999 returns, at least 1000 needed")])
def test_returns_of_the_whole_sweep(of: int, expected: str) -> None:
    assert problem(*WHOLE, of=of) == expected


def test_sample_of_zero_or_one_point() -> None:
    assert problem() == "covered: 0 returns, at least 1000 needed"
    assert problem((8.0, 0.0, 0.0), limits=LIMITS.model_copy(update={"sectors": 1})) == ""


@pytest.mark.parametrize(
    "point", [(0.5, 0.0, 0.0), (0.0, 0.0, 0.5), (60.0, 0.0, 0.0), (0.0, 0.0, -30.0), (0.4, 0.0, 0.4)]
)
def test_within_the_ranges_of_the_sensor(point: Point) -> None:
    assert problem(*WHOLE, point) == ""


@pytest.mark.parametrize(
    "point",
    [
        (0.49, 0.0, 0.0),
        (60.01, 0.0, 0.0),
        (43.0, 43.0, 0.0),
        (0.1, 0.1, 0.1),
        (0.3, 0.3, 0.0),
        (0.0, 0.3, 0.3),
        (0.3, 0.0, 0.3),
        (math.nan, 8.0, 0.0),
        (8.0, math.inf, 0.0),
        (8.0, 0.0, -math.inf),
    ],
)
def test_beyond_the_ranges_of_the_sensor_is_no_return(point: Point) -> None:
    assert problem(*WHOLE, point) == "covered: 909 returns, at least 1000 needed"


def test_returns_from_enough_directions() -> None:
    assert problem(*ring(*range(7))) == ""
    assert problem(*ring(3, 4, 5, 6, 7, 8, 9)) == ""
    expected = "covered: returns from 60% of all directions, at least 70% needed"
    assert problem(*ring(*range(6))) == expected
    assert problem(*ring(*range(6)), *ring(*range(6), radius_m=9.0)) == expected


def test_straight_behind_belongs_to_one_direction() -> None:
    """Straight behind is both the end of the last sector and the beginning of the first."""
    behind = (-8.0, 0.0, 0.0)
    assert problem(*ring(1, 2, 3, 4, 5, 6), behind) == ""
    assert problem(*ring(0, 1, 2, 3, 4, 5), behind).startswith("covered: returns from 60%")


def test_a_frozen_sensor_falls_silent() -> None:
    watch = LidarWatch(LIMITS)
    before, after = sweep(*WHOLE), sweep(*WHOLE[1:], (8.0, 0.1, 0.0))
    watch.received(before, 1000, 1.0)
    watch.received(before.copy(), 1000, 2.0)
    assert (watch.problem, watch.age_s(2.0)) == ("frozen", 1.0)
    watch.received(after, 1000, 3.0)
    assert (watch.problem, watch.age_s(3.0)) == ("", 0.0)
    watch.received(sweep(), 1000, 4.0)
    watch.received(after, 1000, 5.0)  # still a duplicate, despite the sweep in between
    assert (watch.problem, watch.age_s(5.0)) == ("frozen", 2.0)


@pytest.mark.parametrize("length", [2, 3, 100])
def test_sweeps_that_are_replayed_are_frozen(length: int) -> None:
    watch = LidarWatch(LIMITS)
    recorded = [sweep(*WHOLE[1:], (8.0, 0.001 * index, 0.0)) for index in range(length)]
    for turn in range(3):
        for index, points in enumerate(recorded):
            watch.received(points, 1000, now_s := 10.0 * turn + 0.1 * index)
            assert watch.problem == ("frozen" if turn else "")
    assert watch.age_s(now_s) == pytest.approx(20.0)


def test_a_sweep_of_long_ago_may_come_again() -> None:
    watch = LidarWatch(LIMITS)
    for index in range(102):
        watch.received(sweep(*WHOLE[1:], (8.0, 0.001 * (index % 101), 0.0)), 1000, 0.1 * index)
        assert watch.problem == ""


def test_a_frozen_sweep_with_holes_is_frozen() -> None:
    watch = LidarWatch(LIMITS)
    holes = sweep(*WHOLE, (math.nan, math.nan, math.nan))
    for now_s in (1.0, 2.0):
        watch.received(holes, 1100, now_s)
    assert (watch.problem, watch.age_s(2.0)) == ("frozen", 1.0)


def test_a_message_that_is_no_sweep() -> None:
    watch = LidarWatch(LIMITS)
    watch.received(sweep(*WHOLE), 1000, 1.0)
    watch.refused("field x is missing")
    assert (watch.problem, watch.age_s(3.0)) == ("field x is missing", 2.0)

"""The benchmark ``navigation``: its judgement of stops."""

from __future__ import annotations

import numpy as np
import pytest

from tests.benchmarks.navigation import _stops, _stops_per_100m
from tests.benchmarks.support.navigation_result import CourseResult


def result(*speeds: float, reached: bool) -> CourseResult:
    """Returns a course of one metre per tick along x."""
    trace = [(float(i), 0.0, 0.0, speed) for i, speed in enumerate(speeds)]
    return CourseResult(reached, 9.0, 1.0, 1.0, 0, "", trace=trace)


@pytest.mark.parametrize(
    ("speeds", "stops"),
    [
        ((0.0, 0.0), 0),
        ((0.0, 0.5, 0.5, 0.0), 1),
        ((0.5, 0.1, 0.5), 0),  # slow, not standing
        ((0.5, 0.1, 0.02, 0.1, 0.02, 0.5, 0.0), 2),  # creeping between two stops is one
    ],
)
def test_stops_are_counted_once(speeds: tuple[float, ...], stops: int) -> None:
    assert _stops(np.array(speeds)) == stops


def test_arrival_is_no_stop_and_a_failed_course_counts_all() -> None:
    speeds = (0.0, 0.5, 0.0, 0.5, 0.0)
    assert _stops_per_100m([result(*speeds, reached=True)]) == pytest.approx(25.0)
    assert _stops_per_100m([result(*speeds, reached=False)]) == pytest.approx(50.0)

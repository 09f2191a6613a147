"""Ages and hold times: exact, and on the safe side if the clock misbehaves."""

from __future__ import annotations

import math

import pytest

from robot_stack.safety.timing import Hold, age_s


@pytest.mark.parametrize(
    ("now_s", "then_s", "age"),
    [
        (5.0, 3.0, 2.0),
        (3.0, 3.0, 0.0),
        (5.0, None, math.inf),
        (2.9, 3.0, math.inf),
        (math.nan, 3.0, math.inf),
        (3.0, math.nan, math.inf),
        (math.inf, 3.0, math.inf),
    ],
)
def test_age(now_s: float, then_s: float | None, age: float) -> None:
    assert age_s(now_s, then_s) == age


def test_hold_counts_from_the_first_true() -> None:
    hold = Hold()
    assert hold.update(False, 1.0) is None
    assert hold.update(True, 2.0) == 0.0
    assert hold.update(True, 2.5) == 0.5
    assert hold.update(True, 4.0) == 2.0
    assert hold.update(False, 5.0) is None
    assert hold.update(True, 6.0) == 0.0


def test_hold_at_time_zero() -> None:
    hold = Hold()
    assert hold.update(True, 0.0) == 0.0
    assert hold.update(True, 1.0) == 1.0


def test_hold_begins_again_when_time_runs_backwards() -> None:
    hold = Hold()
    hold.update(True, 100.0)
    assert hold.update(True, 10.0) == 0.0
    assert hold.update(True, 11.0) == 1.0


def test_hold_that_saw_no_time_never_lasts() -> None:
    hold = Hold()
    hold.update(True, 1.0)
    assert math.isnan(hold.update(True, math.nan) or 0.0)
    assert hold.update(True, 5.0) == 0.0

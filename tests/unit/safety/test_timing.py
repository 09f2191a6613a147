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
    for holds, now_s, lasted_s in (
        (False, -1.0, None),
        (True, 0.0, 0.0),
        (True, 0.5, 0.5),
        (True, 2.0, 2.0),
        (False, 3.0, None),
        (True, 100.0, 0.0),
        (True, 10.0, 0.0),  # time runs backwards
        (True, 11.0, 1.0),
    ):
        assert hold.update(holds, now_s) == lasted_s
    assert math.isnan(hold.update(True, math.nan) or 0.0)
    assert hold.update(True, 12.0) == 0.0, "a hold that saw no time never lasts"

"""The deadlines of the engine's thread."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.wmx.general.worker import next_deadline


@pytest.mark.parametrize(
    ("now_s", "after_s"),
    [(10.0, 10.5), (10.2, 10.5), (10.5, 10.5), (10.9, 10.5), (11.0, 11.0), (11.4, 11.0), (13.7, 13.5)],
)
def test_next_deadline(now_s: float, after_s: float) -> None:
    assert next_deadline(10.0, 0.5, now_s) == after_s


@settings(deadline=None)
@given(st.floats(0.0, 1e5), st.floats(1e-3, 1.0), st.floats(-1.0, 100.0))
def test_it_is_on_the_grid_later_than_the_last_and_never_a_whole_period_behind(
    due_s: float, period_s: float, late_s: float
) -> None:
    after_s = next_deadline(due_s, period_s, due_s + late_s)
    periods = (after_s - due_s) / period_s
    assert periods == pytest.approx(round(periods), abs=1e-4)
    assert round(periods) >= 1
    assert after_s > due_s + late_s - 1.001 * period_s

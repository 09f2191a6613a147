"""The deadlines of the engine's thread."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.wmx.general.worker import next_deadline


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

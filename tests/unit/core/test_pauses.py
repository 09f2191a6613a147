"""Excused pauses: short ones fully, long ones partly, and never enough of them to hide a silence."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.pauses import LONGEST_S, SHARE, PauseBudget


def test_the_budget_fills_while_the_process_runs() -> None:
    budget = PauseBudget(0.0)
    assert budget.excuse(0.25, 0.25) == 0.25
    assert budget.excuse(0.2, 0.85) == pytest.approx(0.1)  # a quarter of 0.4 s of running
    assert budget.excuse(0.25, 9.0) == 0.25


@pytest.mark.parametrize(
    ("begun_s", "late_s", "now_s", "excused_s"),
    [
        (10.0, 0.12, 11.0, 0.12),
        (10.0, 0.6, 11.0, LONGEST_S),
        (0.0, 0.0, 1.0, 0.0),
        (0.0, -1.0, 1.0, 0.0),
        (0.0, math.nan, 1.0, 0.0),
        (5.0, 0.1, 4.0, 0.0),  # time that runs backwards
        (5.0, 0.1, math.nan, 0.0),
    ],
)
def test_short_pauses_are_excused_fully_long_ones_partly(
    begun_s: float, late_s: float, now_s: float, excused_s: float
) -> None:
    assert PauseBudget(begun_s).excuse(late_s, now_s) == excused_s


@given(st.lists(st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 2.0)), max_size=40))
def test_no_sequence_of_pauses_hides_a_silence(stretches: list[tuple[float, float]]) -> None:
    """(running time, following pause): the excused time stays below a share of the total plus one pause."""
    budget, now_s, excused_s = PauseBudget(0.0), 0.0, 0.0
    for ran_s, late_s in stretches:
        now_s += ran_s + late_s
        excused_s += budget.excuse(late_s, now_s)
        assert excused_s <= LONGEST_S + SHARE * now_s + 1e-9


@given(st.lists(st.tuples(st.floats(0.0, 0.5), st.floats(0.0, 0.5)), max_size=40), st.floats(0.05, 1.0))
def test_a_silence_is_noticed_in_time_or_when_the_pause_of_that_moment_ends(
    stretches: list[tuple[float, float]], limit_s: float
) -> None:
    """The silence begins at 0 with a full budget and is detected once age - excused time exceeds the limit."""
    budget, now_s, excused_s = PauseBudget(0.0), 0.0, 0.0
    latest_s = (limit_s + LONGEST_S) / (1.0 - SHARE)
    for ran_s, late_s in stretches:
        now_s += ran_s
        if now_s > latest_s:
            assert now_s - excused_s >= limit_s - 1e-9
        now_s += late_s
        excused_s += budget.excuse(late_s, now_s)
        if now_s > latest_s:
            assert now_s - excused_s >= limit_s - 1e-9

"""The draw and the judgement of the benchmark of missions."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.benchmarks.missions import Outcome, draw

CASES = [draw(seed) for seed in range(1, 61)]


@pytest.mark.parametrize(
    ("changes", "success", "stranded"),
    [
        ({}, True, False),
        ({"aboard": True}, False, True),
        ({"state": "PAUSED", "aboard": True}, False, False),
        ({"state": "FAILED", "aboard": True}, False, True),
        ({"touched": ("wall",)}, False, False),
        ({"problems": ("row_not_raised",)}, False, False),
        ({"order_lost": True}, False, False),
    ],
)
def test_what_counts_as_success(changes: dict[str, object], success: bool, stranded: bool) -> None:
    case = next(case for case in CASES if not case.critical)
    good = Outcome(case, "COMPLETED", "", 60.0, aboard=False, touched=(), problems=(), order_lost=False)
    outcome = replace(good, **changes)  # type: ignore[arg-type]
    assert (outcome.success, outcome.stranded) == (success, stranded)


def test_a_critical_battery_may_pause_the_mission() -> None:
    case = next(case for case in CASES if case.critical)
    paused = Outcome(case, "PAUSED", "", 60.0, aboard=True, touched=(), problems=(), order_lost=False)
    assert paused.success

"""The steps of the start, with times computed by hand."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.wmx.manipulator.startup import (
    HOLD_S,
    NEXT,
    START,
    Level,
    Line,
    Outcome,
    Progress,
    Result,
    Rule,
    Step,
    advance,
    back_to,
    is_past,
)

RULE = Rule(attempts=3, pause_s=2.0, longest_pause_s=10.0, limit_s=5.0)
RULES = dict.fromkeys(Step, RULE)
DONE = Outcome(Result.DONE)
REFUSED = Outcome(Result.REFUSED, "no")
ASKED = Outcome(Result.ASKED, "not yet")


def test_the_documented_order():
    steps, progress = [], START
    while progress.step is not Step.READY:
        steps.append(progress.step)
        progress, line = advance(progress, DONE, 0.0, RULES)
        assert line is None
    assert steps == [
        Step.DEVICE,
        Step.SCAN,
        Step.COMMUNICATION,
        Step.PARAMETERS,
        Step.AXIS_REPORT,
        Step.CLEAR_ALARMS,
        Step.SERVO_ON,
    ]
    assert NEXT[Step.READY] is Step.READY
    assert not progress.due(1e9)


def test_pauses_are_even_for_the_attempts_then_double_up_to_the_longest():
    assert [RULE.pause_after(failures) for failures in range(1, 9)] == [2.0, 2.0, 2.0, 4.0, 8.0, 10.0, 10.0, 10.0]


def test_a_longest_pause_below_the_pause_changes_nothing():
    assert Rule(1, 2.0, 1.0, 1.0).pause_after(20) == 2.0


@given(st.integers(1, 10**6))
def test_pauses_stay_within_their_bounds(failures: int):
    assert 2.0 <= RULE.pause_after(failures) <= 10.0


def test_failures_are_logged_per_attempt_then_once_as_error():
    progress, lines = START, []
    for _ in range(5):
        progress, line = advance(progress, REFUSED, 100.0, RULES)
        lines.append(line)
    assert lines == [
        Line(Level.WARNING, "device: attempt 1 of 3 failed, next in 2 s: no"),
        Line(Level.WARNING, "device: attempt 2 of 3 failed, next in 2 s: no"),
        Line(Level.ERROR, "device: 3 attempts failed, still trying: no"),
        None,
        None,
    ]
    _, line = advance(progress, Outcome(Result.REFUSED, "something else"), 100.0, RULES)
    assert line == Line(Level.WARNING, "device: something else")


def test_a_failed_step_is_due_after_its_pause():
    progress, _ = advance(START, REFUSED, 100.0, RULES)
    assert not progress.due(101.99)
    assert progress.due(102.0)
    assert progress.failures == 1


def test_requested_step_is_awaited_until_its_timeout():
    progress = Progress(Step.SERVO_ON)
    progress, line = advance(progress, ASKED, 10.0, RULES)
    assert (progress.waiting, progress.due(10.0), line) == (True, False, None)
    progress, line = advance(progress, ASKED, 14.9, RULES)
    assert (progress.asked_s, line) == (10.0, None)
    progress, line = advance(progress, ASKED, 15.0, RULES)
    assert line == Line(Level.WARNING, "servo on: attempt 1 of 3 failed, next in 2 s: not yet after 5 s")
    assert not progress.waiting
    assert progress.due(17.0)


def test_completed_step_resets_failures_and_is_logged():
    progress, _ = advance(START, REFUSED, 0.0, RULES)
    progress, line = advance(progress, Outcome(Result.DONE, "open"), 2.0, RULES)
    assert progress == Progress(Step.SCAN)
    assert progress.due(2.0)
    assert line == Line(Level.INFO, "device: open")


def test_the_level_of_a_step_that_is_done():
    _, line = advance(START, Outcome(Result.DONE, "left out", Level.WARNING), 0.0, RULES)
    assert line == Line(Level.WARNING, "device: left out")


def test_held_step_is_not_a_failure_and_logged_once():
    held = Outcome(Result.HELD, "emergency stop")
    progress, line = advance(Progress(Step.SERVO_ON), held, 0.0, RULES)
    assert line == Line(Level.INFO, "servo on: emergency stop")
    assert (progress.failures, progress.due(0.05), progress.due(HOLD_S)) == (0, False, True)
    again, line = advance(progress, held, 0.1, RULES)
    assert (again.failures, line) == (0, None)


def test_back_to_a_step_is_due_at_once():
    progress = back_to(Step.COMMUNICATION, "lost")
    assert progress.due(-1e9)
    assert math.isnan(progress.asked_s)
    assert progress.text == "lost"


@pytest.mark.parametrize(("step", "other", "past"), [(Step.READY, Step.DEVICE, True), (Step.SCAN, Step.SCAN, False)])
def test_is_past(step: Step, other: Step, past: bool):
    assert is_past(step, other) is past

"""When images are recorded."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.contract import topics
from robot_stack.recording.images import IMAGE_TYPE, DockingWatch, Thinning


@pytest.mark.parametrize("state", ["APPROACH", "SEARCH", "SERVOING", "FINE_ALIGN"])
def test_a_docking_is_under_way_and_a_moment_longer(state):
    watch = DockingWatch(tail_s=2.0)
    assert not watch.active(0.0)
    watch.on_status(state, 1.0)
    assert not watch.active(3.5), "the controller is silent"
    watch.on_status(state, 10.0)
    assert watch.active(10.0)
    for tenth in range(1, 50):
        watch.on_status("FAILED", 10.0 + 0.1 * tenth)
    assert watch.active(11.9)
    assert not watch.active(12.1)


@pytest.mark.parametrize("state", ["IDLE", "DOCKED", "FAILED"])
def test_at_rest_nothing_is_recorded(state):
    watch = DockingWatch(tail_s=2.0)
    watch.on_status(state, 10.0)
    assert not watch.active(10.0)


def test_two_a_second_of_ten_a_second_per_topic():
    thinning = Thinning(2.0)
    times = [0.1 * number for number in range(100)]
    front = [now for now in times if thinning.keeps("/front", now)]
    assert len(front) == 20
    assert front[:3] == pytest.approx([0.0, 0.5, 1.0])
    assert thinning.keeps("/rear", 5.02), "each topic has its own beat"


def test_a_gap_and_a_clock_set_back_start_a_new_beat():
    thinning = Thinning(2.0)
    assert thinning.keeps("/front", 0.0)
    assert thinning.keeps("/front", 7.3)
    assert not thinning.keeps("/front", 7.7)
    assert thinning.keeps("/front", 7.8)
    assert thinning.keeps("/front", -100.0)
    assert not thinning.keeps("/front", -99.6)


@given(st.lists(st.floats(0.001, 3.0), min_size=1, max_size=200), st.floats(0.5, 20.0))
def test_never_more_than_the_rate(steps, rate_hz):
    thinning = Thinning(rate_hz)
    now, passed = 1000.0, []
    for step in steps:
        now += step
        if thinning.keeps("/front", now):
            passed.append(now)
    span = passed[-1] - passed[0]
    # One message may come a period early relative to the previous one, but the mean rate holds.
    assert len(passed) <= span * rate_hz + 2.0
    assert passed[0] == 1000.0 + steps[0]


def test_the_rows_it_is_about():
    assert {row.name for row in topics.TOPICS if row.type == IMAGE_TYPE} == {
        topics.FRONT_IMAGE.name,
        topics.REAR_IMAGE.name,
        topics.VENDOR_FRONT_IMAGE.name,
        topics.VENDOR_REAR_IMAGE.name,
    }

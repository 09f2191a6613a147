"""A contact state counts once all readings agree for a debounce time."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.safety.debounce import Debounce

DEBOUNCE_S = 0.010


@pytest.mark.parametrize("raw", [True, False])
def test_unknown_until_ten_milliseconds_agree(raw: bool) -> None:
    contact = Debounce(DEBOUNCE_S)
    assert contact.state is None
    assert not contact.update(raw, 1.000)
    assert not contact.update(raw, 1.0099)
    assert contact.state is None
    assert contact.update(raw, 1.0101)
    assert contact.state is raw
    assert not contact.update(raw, 1.5)


def test_exactly_the_debounce_time_is_enough() -> None:
    contact = Debounce(0.5)
    contact.update(False, 1.0)
    assert contact.update(False, 1.5)


@pytest.mark.parametrize("before", [True, False])
def test_a_change_takes_the_same_time(before: bool) -> None:
    contact = _settled(before)
    assert not contact.update(not before, 2.0)
    assert not contact.update(not before, 2.009)
    assert contact.state is before
    assert contact.update(not before, 2.011)
    assert contact.state is not before


def test_bouncing_starts_the_time_again() -> None:
    contact = _settled(False)
    contact.update(True, 2.000)
    contact.update(False, 2.008)
    assert not contact.update(True, 2.009)
    assert not contact.update(True, 2.018)
    assert contact.update(True, 2.0195)


def test_a_change_starts_the_next_time_at_zero() -> None:
    contact = _settled(False)
    contact.update(True, 2.0)
    assert contact.update(True, 2.02)
    assert not contact.update(False, 2.021)
    assert contact.state is True
    assert contact.update(False, 2.032)


@pytest.mark.parametrize("back_s", [0.0, 1.5])
def test_time_running_backwards_is_ignored(back_s: float) -> None:
    contact = _settled(True, at_s=1.9)
    contact.update(False, 2.0)
    assert not contact.update(False, back_s)
    assert not contact.update(False, back_s + 0.005)
    assert contact.update(False, back_s + 0.011)


@given(st.lists(st.tuples(st.booleans(), st.floats(0.0005, 0.009)), max_size=60))
def test_never_a_state_without_a_whole_time_of_it(readings: list[tuple[bool, float]]) -> None:
    contact, now_s, last, since_s = Debounce(DEBOUNCE_S), 0.0, None, 0.0
    for raw, dt_s in readings:
        now_s += dt_s
        if raw is not last:
            last, since_s = raw, now_s
        if contact.update(raw, now_s):
            assert contact.state is raw
            assert now_s - since_s >= DEBOUNCE_S


def _settled(state: bool, at_s: float = 1.0) -> Debounce:
    contact = Debounce(DEBOUNCE_S)
    contact.update(state, at_s - 0.1)
    contact.update(state, at_s)
    assert contact.state is state
    return contact

"""The button counts as pressed until a whole debounce time says otherwise."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.safety.debounce import ButtonDebounce

DEBOUNCE_S = 0.010


def test_begins_pressed_and_needs_ten_milliseconds_of_releases() -> None:
    button = ButtonDebounce(DEBOUNCE_S)
    assert button.pressed
    assert not button.update(False, 1.000)
    assert not button.update(False, 1.0099)
    assert button.pressed
    assert button.update(False, 1.0101)
    assert not button.pressed
    assert not button.update(False, 1.02)


def test_exactly_the_debounce_time_is_enough() -> None:
    button = ButtonDebounce(0.5)
    button.update(False, 1.0)
    assert button.update(False, 1.5)


def test_a_press_counts_after_the_same_time() -> None:
    button = _released()
    assert not button.update(True, 2.0)
    assert not button.update(True, 2.009)
    assert not button.pressed
    assert button.update(True, 2.011)
    assert button.pressed


def test_bouncing_starts_the_time_again() -> None:
    button = _released()
    button.update(True, 2.000)
    button.update(False, 2.008)
    assert not button.update(True, 2.009)
    assert not button.update(True, 2.018)
    assert button.update(True, 2.0195)


def test_a_change_starts_the_next_time_at_zero() -> None:
    button = _released()
    button.update(True, 2.0)
    assert button.update(True, 2.02)
    assert not button.update(False, 2.021)
    assert button.pressed


@pytest.mark.parametrize("back_s", [0.0, 1.5])
def test_time_that_runs_backwards_releases_nothing(back_s: float) -> None:
    button = ButtonDebounce(DEBOUNCE_S)
    button.update(False, 2.0)
    assert not button.update(False, back_s)
    assert not button.update(False, back_s + 0.005)
    assert button.update(False, back_s + 0.011)


@given(st.lists(st.tuples(st.booleans(), st.floats(0.0005, 0.009)), max_size=60))
def test_never_released_without_a_whole_time_of_releases(readings: list[tuple[bool, float]]) -> None:
    button, now_s, released_since_s = ButtonDebounce(DEBOUNCE_S), 0.0, None
    for pressed, dt_s in readings:
        now_s += dt_s
        released_since_s = None if pressed else released_since_s if released_since_s is not None else now_s
        was_pressed = button.pressed
        button.update(pressed, now_s)
        if was_pressed and not button.pressed:
            assert released_since_s is not None
            assert now_s - released_since_s >= DEBOUNCE_S


def _released() -> ButtonDebounce:
    button = ButtonDebounce(DEBOUNCE_S)
    button.update(False, 1.0)
    button.update(False, 1.1)
    assert not button.pressed
    return button

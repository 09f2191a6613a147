"""The external display above the robot, as a viewer receives it."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.contract.display import Display
from robot_stack.core import display_picture as picture
from robot_stack.core.config import load
from robot_stack.core.display_patterns import load_patterns
from robot_stack.view.display import DisplayPanel, strokes
from robot_stack.view.params import ViewParams

PARAMS = load(ViewParams, "view").display
PATTERNS = load_patterns()
PANEL = DisplayPanel(PARAMS, PATTERNS)


def wire(state: int | None, t_s: float = 0.0) -> bytes:
    return PANEL.entity(state, t_s, 5).__repr__().encode()


@pytest.mark.parametrize("state", sorted(PATTERNS.states))
def test_display_message_contains_text_of_state(state: int) -> None:
    text = PATTERNS.states[state].text.get(PARAMS.language)
    assert text.encode() in wire(state)


def test_the_light_moves_as_the_display_does() -> None:
    assert wire(Display.NAVIGATING, 0.0) != wire(Display.NAVIGATING, 0.3)
    assert wire(Display.IDLE, 0.0) == wire(Display.IDLE, 0.3)


@pytest.mark.parametrize("state", [None, 15, 255])
def test_unknown_display_state_shows_unknown_text(state: int | None) -> None:
    assert PARAMS.unknown.encode() in wire(state)
    assert b"Ready" not in wire(state)


@pytest.mark.parametrize("name", sorted(set(picture.PICTOGRAMS) - {"none"}))
def test_pictograms_are_lines_within_the_picture(name: str) -> None:
    lines = strokes(picture.PICTOGRAMS[name])
    assert lines
    points = np.concatenate(lines)
    assert np.isfinite(points).all()
    assert all(len(line) > 1 for line in lines)
    low, high = np.array([picture.ICON_X, picture.ICON_Y]), np.array([picture.ICON_SIZE, picture.ICON_SIZE])
    assert (points >= low).all()
    assert (points <= low + high).all()


def test_a_circle_is_round_and_a_closed_line_ends_where_it_began() -> None:
    (circle,) = strokes("M12 3a5 5 0 1 0 .01 0")
    middle = np.array([picture.ICON_X, picture.ICON_Y]) + picture.ICON_SCALE * np.array([12.0, 8.0])
    away = np.hypot(*(circle - middle).T)
    assert away == pytest.approx(5.0 * picture.ICON_SCALE, rel=0.01)
    (square,) = strokes("M2 2h4v4h-4z")
    assert (square[0] == square[-1]).all()

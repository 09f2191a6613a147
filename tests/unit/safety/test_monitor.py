"""The monitor's outputs. Its decisions are tested in the stories."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.limits import SafetyLimit
from robot_stack.safety.button import Contact
from robot_stack.safety.conditions import CONDITIONS
from robot_stack.safety.monitor import Memory, SafetyMonitor
from tests.unit.safety.story import PARAMS, ROBOT, Story


def test_nearest_obstacle_is_unknown_before_the_first_step() -> None:
    assert math.isnan(SafetyMonitor(PARAMS, ROBOT, Memory(), 0.0).nearest_obstacle_m)


def test_the_limit_that_is_watched_is_the_one_that_is_published(monkeypatch: pytest.MonkeyPatch) -> None:
    """This includes its codes: answering a hard stop with a gentle one is a fault."""
    story = Story().healthy()
    watched: list[tuple[SafetyLimit, float]] = []
    monkeypatch.setattr(story.monitor.observation, "limited", lambda *limit: watched.append(limit))
    story.tick()
    assert watched == [(story.verdict.limit, story.now_s)]
    story.estop(True)
    assert watched[1:] == [(SafetyLimit(0.0, 0.0, ("ESTOP_PRESSED",)), story.now_s)]


def test_rows_in_the_order_of_the_contract() -> None:
    assert Story(rows=tuple(reversed(PARAMS.rows))).monitor.rows == tuple(c for c in CONDITIONS if c in PARAMS.rows)


def test_the_hardware_stop_is_the_button_and_not_the_latch() -> None:
    story = Story().healthy()
    assert not story.monitor.button_pressed
    story.estop(True)
    assert not story.run(0.1).monitor.button_pressed
    story.button = Contact.PRESSED
    assert story.run(0.1).monitor.button_pressed
    story.button = Contact.RELEASED
    assert not story.run(0.1).monitor.button_pressed
    assert story.monitor.emergency
    story.button = Contact.UNREADABLE
    assert story.run(0.1).monitor.button_pressed
    story.button = Contact.RELEASED
    story.run(0.1)
    story.monitor.observation.engine(None, story.now_s)
    story.monitor.observation.engine(None, story.now_s + 0.02)
    assert story.monitor.button_pressed

"""Who holds the drive."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.drive.arbitration import NO_COMMAND, Arbiter, Source

A, B = Twist2(1.0, 0.0, 0.0), Twist2(0.0, 0.5, 0.1)


def test_nobody_holds_a_silent_drive():
    assert Arbiter().requested(5.0) == (None, NO_COMMAND)


def test_the_highest_source_that_has_spoken_lately_holds():
    arbiter = Arbiter()
    arbiter.command(Source.NAVIGATION, A, 0.0)
    arbiter.command(Source.DOCKING, B, 0.05)
    assert arbiter.holder(0.1) is Source.DOCKING
    arbiter.command(Source.TELEOP, A, 0.1)
    arbiter.command(Source.NAVIGATION, A, 0.25)
    assert arbiter.holder(0.3) is Source.TELEOP
    assert arbiter.holder(0.31) is Source.NAVIGATION  # docking's last is 0.26 s old, teleop's 0.21 s
    assert arbiter.holder(0.46) is None


def test_command_is_held_exactly_until_its_timeout():
    arbiter = Arbiter()
    arbiter.command(Source.NAVIGATION, A, 1.0)
    source, requested = arbiter.requested(1.2)
    assert (source, requested.twist) == (Source.NAVIGATION, A)
    assert arbiter.requested(1.2001) == (None, NO_COMMAND)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["linear.x", "linear.y", "angular.z"])
def test_refused_command_is_a_stop_and_names_its_field(bad: float, field: str):
    arbiter = Arbiter()
    arbiter.command(Source.NAVIGATION, A, 0.0)
    arbiter.command(Source.TELEOP, A, 0.0)
    values = {"linear.x": 0.1, "linear.y": 0.1, "angular.z": 0.1, field: bad}
    reason = arbiter.command(Source.TELEOP, Twist2(*values.values()), 0.1)
    assert reason == f"teleop command refused: {field} must be finite, is {bad}"
    source, requested = arbiter.requested(0.1)
    assert (source, requested.twist, requested.rate) == (Source.TELEOP, ZERO_TWIST, ZERO_TWIST)


def test_command_that_was_sent_long_ago_is_refused_and_the_one_before_stands():
    arbiter = Arbiter()
    arbiter.command(Source.TELEOP, A, 0.0)
    timeout_s = Source.TELEOP.timeout_s
    reason = arbiter.command(Source.TELEOP, B, 0.1, timeout_s + 0.1)
    assert reason == f"teleop command refused: {timeout_s + 0.1:.2f} s old, at most {timeout_s} s"
    assert arbiter.requested(0.1)[1].twist == A
    assert arbiter.command(Source.TELEOP, B, 0.1, timeout_s) is None
    assert arbiter.requested(0.1)[1].twist == B


def test_time_that_runs_back_makes_commands_old():
    arbiter = Arbiter()
    arbiter.command(Source.NAVIGATION, A, 100.0)
    assert arbiter.holder(50.0) is None


def test_rate_and_age_of_a_course():
    arbiter = Arbiter()
    arbiter.command(Source.NAVIGATION, Twist2(0.50, 0.0, 0.0), 1.00)
    assert arbiter.requested(1.01)[1].rate == ZERO_TWIST  # one command is no course
    arbiter.command(Source.NAVIGATION, Twist2(0.53, 0.0, 0.0), 1.05)
    requested = arbiter.requested(1.07)[1]
    assert requested.rate.vx == pytest.approx(0.6)
    assert requested.age_s == pytest.approx(0.02)


def test_no_rate_across_a_pause_and_none_from_overflow():
    arbiter = Arbiter()
    arbiter.command(Source.NAVIGATION, Twist2(0.5, 0.0, 0.0), 1.0)
    arbiter.command(Source.NAVIGATION, Twist2(0.6, 0.0, 0.0), 1.3)
    assert arbiter.requested(1.3)[1].rate == ZERO_TWIST
    arbiter.command(Source.NAVIGATION, Twist2(1e308, 0.0, 0.0), 1.35)
    arbiter.command(Source.NAVIGATION, Twist2(-1e308, 0.0, 0.0), 1.40)
    assert arbiter.requested(1.4)[1].rate.is_finite()


# --- after an emergency stop -----------------------------------------------------------------------------------------


def test_a_command_that_outlasts_an_emergency_stop_is_not_obeyed_until_it_has_rested():
    arbiter = Arbiter()
    arbiter.command(Source.TELEOP, A, 0.0)
    assert not arbiter.must_rest(Source.TELEOP)
    arbiter.stopped(0.0)
    arbiter.command(Source.TELEOP, A, 0.1)
    arbiter.released(0.1)
    assert arbiter.must_rest(Source.TELEOP)
    arbiter.command(Source.TELEOP, ZERO_TWIST, 0.15)
    arbiter.released(0.15)
    assert not arbiter.must_rest(Source.TELEOP)
    arbiter.command(Source.TELEOP, A, 0.2)
    arbiter.released(0.2)
    assert not arbiter.must_rest(Source.TELEOP)


def test_silence_is_rest_and_each_source_rests_for_itself():
    arbiter = Arbiter()
    arbiter.command(Source.TELEOP, A, 0.0)
    arbiter.command(Source.NAVIGATION, B, 0.1)
    arbiter.stopped(0.1)
    arbiter.released(0.2)
    assert [arbiter.must_rest(source) for source in Source] == [True, False, True]
    arbiter.released(0.21)
    assert [arbiter.must_rest(source) for source in Source] == [True, False, False]


def test_rest_during_the_stop_does_not_help_who_commands_at_its_end():
    arbiter = Arbiter()
    arbiter.command(Source.TELEOP, ZERO_TWIST, 0.1)
    arbiter.stopped(0.1)
    arbiter.command(Source.TELEOP, A, 0.2)
    arbiter.stopped(0.2)
    arbiter.released(0.25)
    assert arbiter.must_rest(Source.TELEOP)


def test_who_rested_until_the_end_may_ask():
    arbiter = Arbiter()
    arbiter.command(Source.TELEOP, A, 0.0)
    arbiter.stopped(0.0)
    arbiter.command(Source.TELEOP, ZERO_TWIST, 0.1)
    arbiter.stopped(0.1)
    arbiter.command(Source.TELEOP, A, 0.15)
    arbiter.released(0.15)
    assert not arbiter.must_rest(Source.TELEOP)
    assert not arbiter.must_rest(None)

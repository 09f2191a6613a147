"""Arbitration of the drive command sources."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.drive.arbitration import NO_COMMAND, Arbiter, Source

A, B = Twist2(1.0, 0.0, 0.0), Twist2(0.0, 0.5, 0.1)


def test_highest_priority_source_with_fresh_command_is_selected():
    arbiter = Arbiter()
    arbiter.command(Source.NAVIGATION, A, 0.0)
    arbiter.command(Source.DOCKING, B, 0.05)
    assert arbiter.holder(0.1) is Source.DOCKING
    arbiter.command(Source.TELEOP, A, 0.1)
    arbiter.command(Source.NAVIGATION, A, 0.25)
    assert arbiter.holder(0.3) is Source.TELEOP
    assert arbiter.holder(0.31) is Source.NAVIGATION  # docking's last command is 0.26 s old, teleop's 0.21 s
    assert arbiter.holder(0.46) is None


def test_command_is_held_exactly_until_its_timeout():
    arbiter = Arbiter()
    arbiter.command(Source.NAVIGATION, A, 1.0)
    source, requested = arbiter.requested(1.2)
    assert (source, requested.twist) == (Source.NAVIGATION, A)
    assert arbiter.requested(1.2001) == (None, NO_COMMAND)
    assert arbiter.requested(0.5) == (None, NO_COMMAND), "time that runs back"


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


def test_rate_and_age_of_a_course():
    arbiter = Arbiter()
    arbiter.command(Source.NAVIGATION, Twist2(0.50, 0.0, 0.0), 1.00)
    assert arbiter.requested(1.01)[1].rate == ZERO_TWIST  # a rate needs two commands
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


def released(*, at_s: float = 1.0) -> Arbiter:
    """Returns an arbiter after the end of an emergency stop."""
    arbiter = Arbiter()
    arbiter.stopped()
    arbiter.released(at_s)
    return arbiter


def test_a_held_command_is_obeyed_only_after_an_explicit_standstill_which_each_stop_requires():
    never_stopped = Arbiter()
    never_stopped.released(0.0)
    assert not any(never_stopped.must_rest(source) for source in Source)
    arbiter = released()
    arbiter.command(Source.TELEOP, A, 1.1)
    arbiter.released(1.6)
    arbiter.command(Source.TELEOP, A, 1.6)  # the pause between is no request of standstill
    assert arbiter.must_rest(Source.TELEOP)
    arbiter.command(Source.TELEOP, ZERO_TWIST, 1.7)
    arbiter.command(Source.TELEOP, A, 1.8)
    arbiter.released(1.9)
    assert not arbiter.must_rest(Source.TELEOP)
    arbiter.stopped()
    arbiter.released(2.0)
    assert arbiter.must_rest(Source.TELEOP)


def test_each_source_rests_for_itself():
    arbiter = released()
    arbiter.command(Source.DOCKING, ZERO_TWIST, 1.1)
    assert [arbiter.must_rest(source) for source in Source] == [source is not Source.DOCKING for source in Source]
    assert not arbiter.must_rest(None)


def test_a_standstill_during_the_stop_does_not_count():
    arbiter = Arbiter()
    arbiter.stopped()
    arbiter.command(Source.TELEOP, ZERO_TWIST, 0.5)
    arbiter.stopped()
    arbiter.released(1.0)
    assert arbiter.must_rest(Source.TELEOP)
    arbiter.command(Source.TELEOP, ZERO_TWIST, 1.1, sent_ago_s=0.15)  # sent before the release
    assert arbiter.must_rest(Source.TELEOP)
    arbiter.command(Source.TELEOP, ZERO_TWIST, 1.1, sent_ago_s=0.1)
    assert not arbiter.must_rest(Source.TELEOP)


@pytest.mark.parametrize("nearly", [Twist2(math.nan, 0.0, 0.0), Twist2(1e-9, 0.0, 0.0), Twist2(0.0, 0.0, -1e-9)])
def test_nearly_zero_command_does_not_count_as_standstill_request(nearly: Twist2):
    arbiter = released()
    arbiter.command(Source.TELEOP, nearly, 1.1)
    assert arbiter.must_rest(Source.TELEOP)

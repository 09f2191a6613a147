"""A world that waits for a stack that falls behind."""

from __future__ import annotations

from sim.lockstep import Lockstep


def test_who_was_never_heard_is_not_waited_for() -> None:
    assert Lockstep({"/odom": 0.1}).behind(1000.0) == []


def test_who_falls_behind_is_waited_for_until_heard() -> None:
    steps = Lockstep({"/odom": 0.1, "/safety/status": 0.3})
    steps.heard("/odom", 1.0)
    steps.heard("/safety/status", 1.0)
    assert steps.behind(1.05) == []
    assert steps.behind(1.11) == ["/odom"]
    assert steps.behind(1.31) == ["/odom", "/safety/status"]
    steps.heard("/odom", 1.31)
    assert steps.behind(1.31) == ["/safety/status"]


def test_who_stays_silent_is_given_up_until_heard_again() -> None:
    steps = Lockstep({"/odom": 0.1})
    steps.heard("/odom", 1.0)
    steps.give_up(steps.behind(1.2))
    assert steps.behind(5.0) == []
    steps.heard("/odom", 5.0)
    assert steps.behind(5.2) == ["/odom"]

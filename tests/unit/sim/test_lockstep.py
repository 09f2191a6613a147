"""When a simulated world waits for whom."""

from __future__ import annotations

import math

from sim.run.lockstep import Lockstep

TOLERANCE_S = 0.03


def test_who_is_late_is_waited_for() -> None:
    lockstep = Lockstep(TOLERANCE_S)
    assert lockstep.behind({"a": 1.0, "b": 1.0}, 1.02) == []
    assert lockstep.behind({"a": 1.0, "b": 1.02}, 1.04) == ["a"]
    assert lockstep.behind({"a": 1.04, "b": 1.02}, 1.04) == []


def test_who_has_nothing_to_do_is_not_waited_for() -> None:
    assert Lockstep(TOLERANCE_S).behind({"a": math.inf}, 1000.0) == []


def test_who_stays_late_is_given_up_until_it_moves_on() -> None:
    lockstep = Lockstep(TOLERANCE_S)
    hung = {"a": 1.0}
    lockstep.give_up(lockstep.behind(hung, 2.0), hung)
    assert lockstep.behind(hung, 3.0) == []
    assert lockstep.behind({"a": 3.0}, 3.02) == []
    assert lockstep.behind({"a": 3.0}, 3.1) == ["a"]


def test_who_was_given_up_and_is_gone_is_forgotten() -> None:
    lockstep = Lockstep(TOLERANCE_S)
    lockstep.give_up(["a"], {"a": 1.0})
    assert lockstep.behind({}, 2.0) == []
    assert lockstep.behind({"a": 1.0}, 2.0) == ["a"]


def test_giving_up_somebody_who_has_gone_meanwhile() -> None:
    lockstep = Lockstep(TOLERANCE_S)
    lockstep.give_up(["a"], {})
    assert lockstep.behind({"a": 1.0}, 2.0) == ["a"]

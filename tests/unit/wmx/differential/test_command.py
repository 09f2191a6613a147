"""The newest twist, its age, and the rest that must come before motion."""

from __future__ import annotations

import math

import pytest

from robot_stack.wmx.differential.command import BadTwist, TwistCommand, Wish

REST = Wish(0.0, 0.0)


def speeds(wish: Wish) -> tuple[float, float]:
    return wish.linear_mps, wish.angular_radps


def fields(linear: float = 0.0, angular: float = 0.0, **others: float) -> dict[str, float]:
    zeros = dict.fromkeys(("linear.x", "linear.y", "linear.z", "angular.x", "angular.y", "angular.z"), 0.0)
    return zeros | {"linear.x": linear, "angular.z": angular} | {k.replace("_", "."): v for k, v in others.items()}


@pytest.fixture
def command() -> TwistCommand:
    """One that has seen rest."""
    command = TwistCommand(timeout_s=0.25)
    assert command.wish(10.0) == REST
    return command


def test_young_twist_is_the_wish(command: TwistCommand) -> None:
    command.receive(fields(0.5, -0.2), 10.0)
    assert command.wish(10.25) == Wish(0.5, -0.2)


def test_old_twist_is_a_stop_and_says_so(command: TwistCommand) -> None:
    command.receive(fields(0.5), 10.0)
    assert command.wish(10.26) == Wish(0.0, 0.0, "no command for 0.25 s")


def test_time_that_ran_back_makes_a_twist_old(command: TwistCommand) -> None:
    command.receive(fields(0.5), 10.0)
    assert speeds(command.wish(9.0)) == (0.0, 0.0)


@pytest.mark.parametrize("name", ["linear_x", "linear_y", "linear_z", "angular_x", "angular_y", "angular_z"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_bad_twist_is_a_stop_and_named(command: TwistCommand, name: str, value: float) -> None:
    command.receive(fields(0.5), 10.0)
    with pytest.raises(BadTwist, match=f"{name.replace('_', '.')} is {value}, must be finite"):
        command.receive(fields(0.5, **{name: value}), 10.1)
    assert command.wish(10.1) == REST


def test_after_a_bad_twist_a_good_one_drives(command: TwistCommand) -> None:
    with pytest.raises(BadTwist):
        command.receive(fields(math.nan), 10.0)
    command.wish(10.0)
    command.receive(fields(0.5), 10.1)
    assert command.wish(10.1) == Wish(0.5, 0.0)


def test_motion_waits_for_rest(command: TwistCommand) -> None:
    command.receive(fields(0.5), 10.0)
    command.demand_rest()
    assert command.wish(10.1) == Wish(0.0, 0.0, "waiting for the command to be zero or silent once", blocked=True)
    command.receive(fields(0.6), 10.2)
    assert command.wish(10.2).blocked


@pytest.mark.parametrize("rest", ["zero", "silence"])
def test_zero_or_silence_is_rest(command: TwistCommand, rest: str) -> None:
    command.receive(fields(0.5), 10.0)
    command.demand_rest()
    if rest == "zero":
        command.receive(fields(), 10.1)
    assert not command.wish(10.1 if rest == "zero" else 11.0).blocked
    command.receive(fields(0.3), 11.0)
    assert command.wish(11.0) == Wish(0.3, 0.0)


def test_twist_before_anything_was_seen_must_wait() -> None:
    """A node that comes up under a stream of commands must not leap."""
    command = TwistCommand(timeout_s=0.25)
    command.receive(fields(0.5), 10.0)
    assert command.wish(10.0).blocked

"""The newest twist, its age, and the required rest before motion."""

from __future__ import annotations

import math

import pytest

from robot_stack.wmx.differential.command import BadTwist, Command, OldTwist, TwistCommand

REST = Command(0.0, 0.0)


def speeds(requested: Command) -> tuple[float, float]:
    return requested.linear_mps, requested.angular_radps


def fields(linear: float = 0.0, angular: float = 0.0, **others: float) -> dict[str, float]:
    zeros = dict.fromkeys(("linear.x", "linear.y", "linear.z", "angular.x", "angular.y", "angular.z"), 0.0)
    return zeros | {"linear.x": linear, "angular.z": angular} | {k.replace("_", "."): v for k, v in others.items()}


@pytest.fixture
def command() -> TwistCommand:
    """A command that has received rest."""
    command = TwistCommand(timeout_s=0.25)
    assert command.requested(10.0) == REST
    return command


@pytest.mark.parametrize("name", ["linear_x", "linear_y", "linear_z", "angular_x", "angular_y", "angular_z"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_bad_twist_is_a_stop_and_named(command: TwistCommand, name: str, value: float) -> None:
    command.receive(fields(0.5), 10.0)
    with pytest.raises(BadTwist, match=f"{name.replace('_', '.')} is {value}, must be finite"):
        command.receive(fields(0.5, **{name: value}), 10.1)
    assert command.requested(10.1) == REST


def test_twist_age_is_taken_from_stamp(command: TwistCommand) -> None:
    command.receive(fields(0.5), 10.0, age_s=0.2)
    assert command.requested(10.05) == Command(0.5, 0.0)
    assert speeds(command.requested(10.06)) == (0.0, 0.0)
    command.receive(fields(0.5), 10.1, age_s=-5.0)  # a publisher's clock that is ahead does not extend the lifetime
    assert command.requested(10.36).text == "no command for 0.25 s"


def test_a_twist_that_comes_too_old_changes_nothing(command: TwistCommand) -> None:
    command.receive(fields(0.5), 10.0)
    with pytest.raises(OldTwist, match=r"it is 0\.260 s old, at most 0\.25 s"):
        command.receive(fields(0.9), 10.1, age_s=0.26)
    assert command.requested(10.2) == Command(0.5, 0.0)
    assert speeds(command.requested(10.3)) == (0.0, 0.0)


def test_motion_waits_for_rest(command: TwistCommand) -> None:
    command.receive(fields(0.5), 10.0)
    command.demand_rest(10.0)
    assert command.requested(10.1) == Command(0.0, 0.0, "waiting for a zero command or a command timeout", blocked=True)
    command.receive(fields(0.6), 10.2)
    assert command.requested(10.2).blocked


@pytest.mark.parametrize("rest", ["zero", "silence"])
def test_zero_or_silence_is_rest(command: TwistCommand, rest: str) -> None:
    command.receive(fields(0.5), 10.0)
    command.demand_rest(10.0)
    if rest == "zero":
        command.receive(fields(), 10.1)
    assert not command.requested(10.1 if rest == "zero" else 11.0).blocked
    command.receive(fields(0.3), 11.0)
    assert command.requested(11.0) == Command(0.3, 0.0)


def test_silence_before_rest_demand_does_not_count_as_rest(command: TwistCommand) -> None:
    """A node hung: its first read finds an old twist and a stopped drive, then the stream continues."""
    command.receive(fields(0.5), 10.0)
    assert speeds(command.requested(15.0)) == (0.0, 0.0)
    command.demand_rest(15.0)
    command.requested(15.01)
    command.receive(fields(0.5), 15.02)
    assert command.requested(15.02).blocked
    command.requested(15.28)
    command.receive(fields(0.5), 15.3)
    assert command.requested(15.3) == Command(0.5, 0.0)


def test_twist_before_anything_was_seen_must_wait() -> None:
    """A node that starts while commands are being published must not start the motion at once."""
    command = TwistCommand(timeout_s=0.25)
    command.receive(fields(0.5), 10.0)
    assert command.requested(10.0).blocked


def test_silence_counts_only_after_discovery_time() -> None:
    """The node discovers an existing stream only after a while; that stream must not start the base."""
    command = TwistCommand(timeout_s=0.25, discovered_s=2.5)
    command.requested(1.0)
    command.receive(fields(0.5), 1.1)
    assert command.requested(1.15).blocked
    assert command.requested(1.5).linear_mps == 0.0  # the silence counts from now on
    command.receive(fields(0.5), 1.6)
    assert command.requested(1.65).linear_mps == 0.5

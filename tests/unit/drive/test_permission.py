"""A stop has priority over everything, and silence is a stop."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.contract.faults import FAULTS, join_codes, split_codes
from robot_stack.core.geometry import Twist2
from robot_stack.core.limits import MotionLimits, SafetyLimit, SpeedLimit
from robot_stack.drive.arbitration import NO_COMMAND, Command, Source
from robot_stack.drive.permission import Action, Situation, permit
from tests.unit.drive.robot import EMPTY, WITH_PASSENGER

WISH = Command(Twist2(1.0, 0.0, 0.0))


def limited(linear_mps: float, angular_radps: float, reason: str) -> SafetyLimit:
    """The limit of a message of /safety/velocity_limit."""
    return SafetyLimit(linear_mps, angular_radps, split_codes(reason))


ALL_WELL = Situation(
    emergency_stop=False,
    joint_states_fresh=True,
    safety_status_fresh=True,
    speed_limit=limited(1.5, 1.0, ""),
    speed_limit_fresh=True,
    passenger=False,
    holder=Source.NAVIGATION,
    requested=WISH,
)


def decide(**changes: object):
    return permit(replace(ALL_WELL, **changes), EMPTY, WITH_PASSENGER)  # type: ignore[arg-type]


def test_all_well():
    permission = decide()
    assert (permission.action, permission.requested, permission.limits) == (Action.DRIVE, WISH, EMPTY)
    assert (permission.ready, permission.reason) == (True, "navigation drives")
    assert decide(holder=None, requested=NO_COMMAND).reason == "idle"


@pytest.mark.parametrize(
    ("limit", "passenger", "expected"),
    [
        (limited(0.0, 0.0, "LOCALIZATION_LOST,SLOPE"), False, EMPTY.slower(SpeedLimit(0.0, 0.0))),
        (limited(0.3, 0.5, "COLLISION_IMMINENT"), False, EMPTY.slower(SpeedLimit(0.3, 0.5))),
        (limited(1.2, 0.4, "OBSTACLE_NEAR"), True, WITH_PASSENGER.slower(SpeedLimit(1.0, 0.4))),
    ],
    ids=["soft stop", "slow is no hard stop", "passenger"],
)
def test_limits(limit: SafetyLimit, passenger: bool, expected: MotionLimits):
    permission = decide(speed_limit=limit, passenger=passenger)
    assert (permission.action, permission.limits) == (Action.DRIVE, expected)


@pytest.mark.parametrize(
    ("changes", "action", "ready"),
    [
        ({"emergency_stop": True}, Action.HALT, True),
        ({"emergency_stop": True, "joint_states_fresh": False}, Action.HALT, True),
        ({"joint_states_fresh": False}, Action.BRAKE, False),
        ({"joint_states_fresh": False, "safety_status_fresh": False}, Action.BRAKE, False),
        ({"safety_status_fresh": False}, Action.BRAKE, False),
        ({"speed_limit_fresh": False}, Action.BRAKE, False),
        ({"speed_limit": None, "speed_limit_fresh": False, "safety_status_fresh": False}, Action.DRIVE, False),
        ({"must_rest": True}, Action.DRIVE, True),
        ({"speed_limit": limited(0.0, 0.0, "LOCALIZATION_LOST, SLOPE")}, Action.BRAKE, True),
        ({"speed_limit": limited(0.0, 0.0, "LOCALIZATION_LOST,")}, Action.BRAKE, True),
        ({"speed_limit": limited(0.0, 0.5, "")}, Action.BRAKE, True),
        ({"speed_limit": limited(-1.0, 0.5, "")}, Action.BRAKE, True),
        ({"speed_limit": limited(math.nan, math.nan, "")}, Action.BRAKE, True),
    ],
)
def test_whatever_is_wrong_the_wish_is_standstill(changes: dict[str, object], action: Action, ready: bool):
    permission = decide(**changes)
    assert (permission.action, permission.requested, permission.ready) == (action, NO_COMMAND, ready)
    assert permission.reason


@given(st.sets(st.sampled_from([*(fault.code for fault in FAULTS), "WAY_UNSEEN", "NEW_CODE"])), st.randoms())
def test_a_stop_is_hard_by_its_codes_alone(codes: set[str], draw: random.Random):
    """By which are in it: not by their order, nor by a text for people."""
    order = sorted(codes)
    draw.shuffle(order)
    hard = not codes or not codes <= {"LOCALIZATION_LOST", "SLOPE"}
    assert split_codes(join_codes(order)) == tuple(order)
    assert decide(speed_limit=SafetyLimit(0.0, 0.0, tuple(order))).action is (Action.BRAKE if hard else Action.DRIVE)

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
from robot_stack.core.limits import SafetyLimit, SpeedLimit
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


def test_permission_reports_idle_without_command():
    assert decide(holder=None, requested=NO_COMMAND).reason == "idle"


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
        ({"speed_limit": limited(0.0, 0.0, "COLLISION_IMMINENT")}, Action.BRAKE, True),
        ({"speed_limit": limited(0.0, 0.0, "PASSENGER_ONBOARD,COLLISION_IMMINENT")}, Action.BRAKE, True),
        ({"speed_limit": limited(0.0, 0.0, "TILT")}, Action.BRAKE, True),
        ({"speed_limit": limited(0.0, 0.0, "COLLISION_IMMINENT, NODE_DEAD")}, Action.BRAKE, True),
        ({"speed_limit": limited(0.0, 0.0, "LOCALIZATION_LOST, SLOPE")}, Action.BRAKE, True),
        ({"speed_limit": limited(0.0, 0.0, "LOCALIZATION_LOST,NEW_CODE")}, Action.BRAKE, True),
        ({"speed_limit": limited(0.0, 0.0, "LOCALIZATION_LOST,")}, Action.BRAKE, True),
        ({"speed_limit": limited(0.0, 0.0, "LOCALIZATION_LOST,LIDAR_TIMEOUT")}, Action.BRAKE, True),
        ({"speed_limit": limited(0.0, 0.0, "NEW_CODE")}, Action.BRAKE, True),
        ({"speed_limit": limited(0.0, 0.0, "")}, Action.BRAKE, True),
        ({"speed_limit": limited(0.0, 0.5, "")}, Action.BRAKE, True),
        ({"speed_limit": limited(-1.0, 0.5, "")}, Action.BRAKE, True),
        ({"speed_limit": limited(math.nan, math.nan, "")}, Action.BRAKE, True),
    ],
)
def test_whatever_is_wrong_the_wish_is_standstill(changes: dict[str, object], action: Action, ready: bool):
    permission = decide(**changes)
    assert (permission.action, permission.requested, permission.ready) == (action, NO_COMMAND, ready)
    assert permission.reason


@pytest.mark.parametrize("reason", ["LOCALIZATION_LOST", "SLOPE", "LOCALIZATION_LOST,SLOPE"])
def test_soft_stop_keeps_the_comfort(reason: str):
    permission = decide(speed_limit=limited(0.0, 0.0, reason))
    assert permission.action is Action.DRIVE
    assert permission.limits.speed_mps == 0.0


def test_nonzero_speed_limit_is_not_a_hard_stop():
    assert decide(speed_limit=limited(0.3, 0.5, "COLLISION_IMMINENT")).action is Action.DRIVE
    assert decide(speed_limit=limited(0.3, 0.5, "SLOPE")).limits.speed_mps == 0.3


def test_passenger_limits_and_safety_limit_both_hold():
    permission = decide(passenger=True, speed_limit=limited(1.2, 0.4, "OBSTACLE_NEAR"))
    assert permission.limits == WITH_PASSENGER.slower(SpeedLimit(1.0, 0.4))


@given(st.sets(st.sampled_from([*(fault.code for fault in FAULTS), "WAY_UNSEEN", "NEW_CODE"])), st.randoms())
def test_a_stop_is_hard_by_its_codes_alone(codes: set[str], draw: random.Random):
    """By which are in it: not by their order, nor by a text for people."""
    order = sorted(codes)
    draw.shuffle(order)
    hard = not codes or not codes <= {"LOCALIZATION_LOST", "SLOPE"}
    assert split_codes(join_codes(order)) == tuple(order)
    assert decide(speed_limit=SafetyLimit(0.0, 0.0, tuple(order))).action is (Action.BRAKE if hard else Action.DRIVE)

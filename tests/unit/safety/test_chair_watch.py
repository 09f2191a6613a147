"""A wheelchair on the latch: attached, held or loose, and which source may move the robot in each state."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from robot_stack.contract import topics
from robot_stack.contract.model import SafetyAction, SafetyState
from robot_stack.core.geometry import Twist2
from robot_stack.core.limits import SpeedLimit
from robot_stack.safety.chair_watch import ChairWatch, LatchStatement
from robot_stack.safety.inputs import Finding, LatchReading, Level
from robot_stack.safety.monitor import Memory
from tests.unit.safety.story import CLOSED, OPEN, PARAMS, Story

NORMAL, DEGRADED, AVOIDANCE, EMERGENCY = SafetyState
BOTH = LatchReading(closed=True, open=True, opening=False)
NEITHER = LatchReading(closed=False, open=False, opening=False)
ON_COMMAND = replace(NEITHER, opening=True)
STALE_S = topics.LATCH_STATUS.stale_limit_s
CREEP_MPS = PARAMS.undocking.max_speed_mps
HELD, FREE = LatchStatement(attached=True, undocking=False), LatchStatement(attached=False, undocking=False)
UNDOCKING = LatchStatement(attached=True, undocking=True)
RIDE_RADPS = 1.0 / 0.0825


def riding() -> Story:
    """With a wheelchair at 1.0 m/s."""
    story = Story().carry().healthy()
    state(story, HELD)
    story.wheel_radps = RIDE_RADPS
    return story.run(0.5).expect(NORMAL, (), linear_mps=1.0, reason="PASSENGER_ONBOARD")


def state(story: Story, statement: LatchStatement) -> Story:
    story.monitor.observation.chair.stated(statement, story.now_s)
    return story


def test_opened_latch_stops_and_reset_permits_only_slow_undocking() -> None:
    story = riding()
    story.latch = OPEN
    story.tick().expect(EMERGENCY, ("CHAIR_LOOSE", "LATCH_NOT_CLOSED"))
    story.wheel_radps = 0.0
    story.run(1.0)
    assert story.reset().success
    story.request = Twist2(1.0, 0.0, 0.0)
    story.run(5.0).expect(DEGRADED, ("LATCH_NOT_CLOSED",), linear_mps=0.0, reason="LATCH_NOT_CLOSED")
    story.request = None
    story.run(1.0)
    state(story, UNDOCKING).tick().expect(NORMAL, (), linear_mps=CREEP_MPS, reason="UNDOCKING")
    assert story.verdict.limit.angular_radps == PARAMS.undocking.max_yaw_rate_radps
    story.monitor.observation.chair.on_passenger(False)
    state(story, FREE).tick().expect(NORMAL, (), linear_mps=1.5)


@pytest.mark.parametrize("reading", [OPEN, NEITHER, BOTH, ON_COMMAND])
def test_every_reading_but_a_confirmed_one_is_a_loose_chair_while_the_robot_moves(reading: LatchReading) -> None:
    story = riding()
    story.latch = reading
    story.tick().expect(EMERGENCY, ("CHAIR_LOOSE", "LATCH_NOT_CLOSED"))
    assert f"closed={int(reading.closed)}, open={int(reading.open)}" in story.monitor.details["CHAIR_LOOSE"]


def test_returned_contact_clears_only_faults_that_are_not_latched() -> None:
    story = riding()
    story.latch = NEITHER
    story.tick()
    story.latch = CLOSED
    story.run(0.1).expect(EMERGENCY, ("CHAIR_LOOSE",))
    story.wheel_radps = 0.0
    story.run(1.0)
    assert story.reset().success
    story.expect(NORMAL, (), linear_mps=1.0)


def test_a_latch_that_opens_on_command_at_standstill_is_no_emergency() -> None:
    story = riding()
    story.wheel_radps = 0.0
    story.run(0.5)
    state(story, UNDOCKING)
    story.latch = ON_COMMAND
    story.tick().expect(NORMAL, (), linear_mps=CREEP_MPS, reason="UNDOCKING")
    story.latch = OPEN
    story.tick().expect(NORMAL, (), linear_mps=CREEP_MPS, reason="UNDOCKING")


def test_a_latch_that_opens_at_standstill_without_a_command_is_loose() -> None:
    story = riding()
    story.wheel_radps = 0.0
    story.run(0.5)
    story.latch = NEITHER
    story.tick().expect(EMERGENCY, ("CHAIR_LOOSE", "LATCH_NOT_CLOSED"))


def test_silent_joint_states_are_no_standstill() -> None:
    story = riding()
    story.wheel_radps = None
    story.latch = ON_COMMAND
    story.run(0.2)
    assert "CHAIR_LOOSE" in story.verdict.faults


def open_and_undocking() -> Story:
    story = riding()
    story.wheel_radps = 0.0
    story.run(0.5)
    state(story, UNDOCKING)
    story.latch = OPEN
    story.monitor.observation.chair.contacts(ON_COMMAND)
    return story.step()


def test_stale_undocking_status_permits_no_motion() -> None:
    open_and_undocking().before(STALE_S).expect(NORMAL, linear_mps=CREEP_MPS).past().expect(DEGRADED, linear_mps=0.0)
    story = state(open_and_undocking(), HELD)
    story.tick().expect(DEGRADED, ("LATCH_NOT_CLOSED",), linear_mps=0.0)


@pytest.mark.parametrize(
    ("source", "limit_mps"), [("/docking/cmd_vel", CREEP_MPS), ("/cmd_vel", 0.0), ("/teleop/cmd_vel", 0.0)]
)
def test_only_the_docking_controller_may_move_the_robot(source: str, limit_mps: float) -> None:
    story = open_and_undocking()
    story.monitor.observation.commands.request(source, Twist2(-0.1, 0.0, 0.0), story.now_s)
    story.tick().expect(NORMAL if limit_mps else DEGRADED, linear_mps=limit_mps)


def test_a_wheelchair_that_is_undocked_from_does_not_move_with_the_robot() -> None:
    """Its sides are not obstacles if the robot turns slightly while it backs off."""
    story = open_and_undocking()
    story.obstacles = np.array([(1.3, 0.42, 0.5)], np.float32)
    story.driven = Twist2(-0.1, 0.0, 0.05)
    for _ in range(10):
        story.monitor.observation.commands.request("/docking/cmd_vel", story.driven, story.now_s)
        story.tick().expect(NORMAL, linear_mps=CREEP_MPS)
    story = riding()
    story.obstacles, story.request = np.array([(1.3, 0.42, 0.5)], np.float32), Twist2(-0.1, 0.0, 0.05)
    story.driven = story.request
    story.run(0.2)
    assert "COLLISION_IMMINENT" in story.verdict.faults, "a wheelchair that is held does"


def test_contacts_that_contradict_each_other_stop_an_empty_robot() -> None:
    story = Story().healthy()
    story.latch = BOTH
    story.tick().expect(DEGRADED, ("LATCH_NOT_CLOSED",), linear_mps=0.0)
    story.latch = OPEN
    story.tick().expect(NORMAL, ())


def test_contacts_that_cannot_be_read_neither_raise_nor_clear() -> None:
    story = Story(rows=("ESTOP_PRESSED", "CHAIR_LOOSE", "LATCH_NOT_CLOSED")).carry().run(1.0).expect(NORMAL, ())
    state(story, HELD)
    story.latch = None
    story.run(1.0).expect(NORMAL, (), linear_mps=1.0)
    story.latch = OPEN
    story.tick().expect(EMERGENCY, ("CHAIR_LOOSE", "LATCH_NOT_CLOSED"))
    story.latch = None
    story.run(1.0).expect(EMERGENCY, ("CHAIR_LOOSE", "LATCH_NOT_CLOSED"))
    assert "CHAIR_LOOSE: cannot be evaluated" in story.reset().message


@pytest.mark.parametrize("statement", [HELD, None])
def test_a_loose_chair_outlives_a_restart_of_the_monitor(statement: LatchStatement | None) -> None:
    story = Story(memory=Memory(passenger=True))
    story.run(3.0)
    if statement is not None:
        state(story, statement)
    story.run(1.0).expect(DEGRADED, ("LATCH_NOT_CLOSED",), linear_mps=0.0)
    state(story, FREE)
    story.run(0.1).expect(NORMAL, (), linear_mps=1.5)


@pytest.mark.parametrize("statement", [HELD, None])
def test_passenger_false_is_ignored_while_the_latch_is_closed(statement: LatchStatement | None) -> None:
    story = Story().carry().healthy()
    if statement is not None:
        state(story, statement)
    story.monitor.observation.chair.on_passenger(False)
    story.run(1.0).expect(NORMAL, (), linear_mps=1.0, reason="PASSENGER_ONBOARD")
    assert story.monitor.memory.passenger


def test_a_false_of_another_does_not_free_a_loose_chair() -> None:
    story = riding()
    story.latch = OPEN
    story.tick()
    story.monitor.observation.chair.on_passenger(False)
    story.run(0.1).expect(EMERGENCY, ("CHAIR_LOOSE", "LATCH_NOT_CLOSED"))


LIMIT = SpeedLimit(0.15, 0.10)


def test_passenger_attached_and_detached() -> None:
    found = ChairWatch(False, LIMIT, STALE_S)
    found.on_passenger(True)
    assert (found.attached, found.carried) == (True, True)  # no latch statement: the report counts
    found.on_passenger(False)
    assert (found.attached, found.carried) == (False, False)
    found.contacts(CLOSED)
    assert (found.closed, found.attached, found.carried) == (True, True, True)
    found.contacts(OPEN)
    assert (found.closed, found.attached, found.carried) == (False, False, False)
    found.stated(FREE, 0.0)
    found.on_passenger(True)
    assert (found.attached, found.carried) == (False, True)  # sets limits and outline, but no chair can get loose
    found.stated(HELD, 0.0)
    assert found.attached
    found.on_passenger(False)
    assert found.carried


def test_missing_message_keeps_the_state() -> None:
    for before in (False, True):
        found = ChairWatch(before, LIMIT, STALE_S)
        found.contacts(OPEN)
        found.contacts(None)
        assert (found.attached, found.carried, found.closed) == (before, before, False)
        assert found.loose(stands=True).level.name == "UNKNOWN"
        assert found.not_held(None, math.nan).level.name == "UNKNOWN"
        assert found.undocking(None, math.nan) is None


def test_an_attached_chair_that_was_never_held_is_not_let_go() -> None:
    found = ChairWatch(True, LIMIT, STALE_S)
    found.contacts(OPEN)
    assert found.loose(stands=False).level.name == "CLEAR"
    assert found.not_held(None, 0.0).action is SafetyAction.STOP


def test_a_chair_that_is_stated_free_as_the_latch_opens_is_not_let_go() -> None:
    found = ChairWatch(False, LIMIT, STALE_S)
    found.contacts(CLOSED)
    assert found.loose(stands=True).level.name == "CLEAR"
    found.stated(FREE, 0.0)
    found.contacts(NEITHER)
    assert found.loose(stands=False).level.name == "CLEAR"
    assert found.not_held(None, 0.0).level.name == "CLEAR"


# --- the watch alone -------------------------------------------------------------------------------------------------

LIMIT = SpeedLimit(0.15, 0.1)


def watch(*readings: LatchReading, statement: LatchStatement | None = HELD) -> ChairWatch:
    found = ChairWatch(attached=True, undocking_limit=LIMIT, stale_s=STALE_S)
    for reading in readings:
        found.contacts(reading)
        found.loose(stands=False)
    if statement is not None:
        found.stated(statement, 10.0)
    return found


def test_a_loose_chair_asks_for_an_emergency_stop() -> None:
    chair = watch(CLOSED)
    chair.contacts(NEITHER)
    assert chair.loose(stands=False) == Finding(Level.PRESENT, SafetyAction.EMERGENCY_STOP, detail=NEITHER.describe())


def test_a_chair_that_is_not_held_says_what_to_do() -> None:
    found = watch(OPEN).not_held(None, 10.0)
    assert found == Finding(Level.PRESENT, SafetyAction.STOP, detail=f"{OPEN.describe()}: undock")


@pytest.mark.parametrize(
    ("reading", "statement", "source", "limited"),
    [
        (NEITHER, UNDOCKING, None, True),
        (NEITHER, UNDOCKING, topics.DOCKING_CMD_VEL.name, True),
        (NEITHER, UNDOCKING, topics.TELEOP_CMD_VEL.name, False),
        (NEITHER, HELD, None, False),
        (CLOSED, UNDOCKING, None, False),
    ],
)
def test_the_limit_of_undocking_applies_to_a_chair_that_is_not_held(
    reading: LatchReading, statement: LatchStatement, source: str | None, limited: bool
) -> None:
    assert watch(reading, statement=statement).undocking(source, 10.0) == (LIMIT if limited else None)


def test_a_statement_is_fresh_up_to_its_limit() -> None:
    chair = ChairWatch(attached=True, undocking_limit=LIMIT, stale_s=0.5)
    chair.contacts(NEITHER)
    chair.stated(UNDOCKING, 10.0)
    assert chair.undocking(None, 10.5) == LIMIT
    assert chair.undocking(None, 10.51) is None

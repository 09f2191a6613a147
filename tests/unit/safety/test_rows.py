"""One row over time: raise, clear after a while, latch, wait, release."""

from __future__ import annotations

import pytest

from robot_stack.contract.model import Clears, Fault, SafetyAction, SafetyState
from robot_stack.core.limits import SpeedLimit
from robot_stack.safety.inputs import CLEAR, Finding, Level
from robot_stack.safety.rows import ActiveRow, Row

LIMIT = SpeedLimit(0.5, 0.25)
BAD = Finding(Level.PRESENT, SafetyAction.LIMIT, LIMIT, "bad")
WORSE = Finding(Level.PRESENT, SafetyAction.STOP, None, "worse")
DEADLY = Finding(Level.PRESENT, SafetyAction.EMERGENCY_STOP, None, "deadly")
WAITING = Finding(Level.WAITING, SafetyAction.STOP, None, "not yet")
UNKNOWN = Finding(Level.UNKNOWN)


def _going(clear_after_s: float) -> Row:
    return Row(Fault("GOING", "", SafetyAction.STOP, SafetyState.COLLISION_AVOIDANCE, Clears.WHEN_GONE, clear_after_s))


def _latching(latched: bool = False) -> Row:
    fault = Fault("LATCHING", "", SafetyAction.EMERGENCY_STOP, SafetyState.EMERGENCY_STOP, Clears.ON_RESET)
    return Row(fault, latched)


def _in_force(detail: str) -> ActiveRow:
    return ActiveRow("LATCHING", SafetyAction.EMERGENCY_STOP, SafetyState.EMERGENCY_STOP, None, detail)


def test_a_new_row_is_not_raised() -> None:
    row = _going(1.0)
    assert row.active() is None
    assert row.action is SafetyAction.NONE
    row.update(CLEAR, 1.0)
    row.update(UNKNOWN, 2.0)
    assert row.active() is None


def test_fault_is_raised_at_once_and_cleared_after_its_time() -> None:
    row = _going(1.0)
    row.update(BAD, 1.0)
    active = ActiveRow("GOING", SafetyAction.LIMIT, SafetyState.COLLISION_AVOIDANCE, LIMIT, "bad")
    assert row.active() == active
    row.update(CLEAR, 2.0)
    row.update(CLEAR, 2.99)
    assert row.active() == active
    row.update(CLEAR, 3.0)
    assert row.active() is None


def test_no_clear_time_clears_at_once() -> None:
    row = _going(0.0)
    row.update(BAD, 1.0)
    row.update(CLEAR, 1.0)
    assert row.active() is None


@pytest.mark.parametrize("between", [BAD, UNKNOWN])
def test_the_clear_time_starts_again(between: Finding) -> None:
    row = _going(1.0)
    row.update(BAD, 1.0)
    row.update(CLEAR, 2.0)
    row.update(between, 2.5)
    row.update(CLEAR, 2.6)
    row.update(CLEAR, 3.5)
    assert row.active() is not None
    row.update(CLEAR, 3.6)
    assert row.active() is None


def test_unknown_finding_keeps_the_state() -> None:
    row = _going(0.0)
    row.update(WORSE, 1.0)
    row.update(UNKNOWN, 99.0)
    assert row.action is SafetyAction.STOP


def test_the_newest_finding_counts_while_it_is_raised() -> None:
    row = _going(1.0)
    for finding in (BAD, WORSE, BAD):
        row.update(finding, 1.0)
        assert row.action is finding.action


def test_latch_stays_after_the_condition_ends() -> None:
    row = _latching()
    row.update(DEADLY, 1.0)
    assert row.latched
    assert row.blocks_release() == "LATCHING: deadly"
    row.update(CLEAR, 2.0)
    row.update(CLEAR, 1000.0)
    assert row.active() == _in_force("deadly")
    assert row.blocks_release() == ""
    row.release()
    assert not row.latched
    assert row.active() is None


def test_unknown_condition_blocks_the_release() -> None:
    row = _latching()
    row.update(DEADLY, 1.0)
    row.update(UNKNOWN, 2.0)
    assert row.blocks_release() == "LATCHING: cannot be evaluated"


def test_waiting_stops_without_a_latch() -> None:
    row = _latching()
    row.update(WAITING, 1.0)
    assert not row.latched
    assert row.active() == ActiveRow("LATCHING", SafetyAction.STOP, SafetyState.DEGRADED, None, "not yet")
    assert row.blocks_release() == ""
    row.update(CLEAR, 2.0)
    assert row.active() is None


def test_waiting_after_a_latch_is_still_the_latch() -> None:
    row = _latching()
    row.update(DEADLY, 1.0)
    row.update(WAITING, 2.0)
    assert row.action is SafetyAction.EMERGENCY_STOP
    assert row.active() == _in_force("not yet")
    assert row.blocks_release() == "LATCHING: not yet"


def test_a_row_that_clears_by_itself_never_latches() -> None:
    row = _going(1.0)
    row.update(WORSE, 1.0)
    assert not row.latched
    assert row.blocks_release() == ""


def test_latched_before_a_restart() -> None:
    row = _latching(latched=True)
    assert row.latched
    assert row.action is SafetyAction.EMERGENCY_STOP
    detail = "latched before a restart"
    assert row.active() == _in_force(detail)
    assert row.blocks_release() == f"LATCHING: {detail}"
    row.update(CLEAR, 1.0)
    assert row.latched
    assert row.blocks_release() == ""

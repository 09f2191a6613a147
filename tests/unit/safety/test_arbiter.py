"""The most severe action has priority; of several limits the smallest applies."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.contract.faults import FAULTS, split_codes
from robot_stack.contract.model import SafetyAction, SafetyState
from robot_stack.core.limits import STANDSTILL, SafetyLimit, SpeedLimit
from robot_stack.safety.arbiter import Verdict, arbitrate
from robot_stack.safety.rows import ActiveRow

OWN, PASSENGER = SpeedLimit(1.5, 1.0), SpeedLimit(1.0, 1.0)
WARN = ActiveRow("WARN", SafetyAction.WARN, SafetyState.DEGRADED, None, "")
SLOW = ActiveRow("SLOW", SafetyAction.LIMIT, SafetyState.DEGRADED, SpeedLimit(0.3, 0.8), "")
TURN = ActiveRow("TURN", SafetyAction.LIMIT, SafetyState.DEGRADED, SpeedLimit(0.5, 0.2), "")
STOP = ActiveRow("STOP", SafetyAction.STOP, SafetyState.COLLISION_AVOIDANCE, None, "")
ESTOP = ActiveRow("ESTOP", SafetyAction.EMERGENCY_STOP, SafetyState.EMERGENCY_STOP, None, "")


STAND = ActiveRow("STAND", SafetyAction.STOP, SafetyState.DEGRADED, None, "")
LOST = replace(STAND, code="LOCALIZATION_LOST")
NEAR = ActiveRow("NEAR", SafetyAction.LIMIT, SafetyState.COLLISION_AVOIDANCE, SpeedLimit(0.3, 0.8), "")


def verdict(
    action: SafetyAction,
    state: SafetyState,
    faults: str,
    limit: tuple[float, float],
    reason: str,
) -> Verdict:
    return Verdict(action, state, tuple(faults.split()), SafetyLimit(*limit, split_codes(reason)))


@pytest.mark.parametrize(
    ("rows", "passenger", "expected"),
    [
        ([], None, verdict(SafetyAction.NONE, SafetyState.NORMAL, "", (1.5, 1.0), "")),
        ([], PASSENGER, verdict(SafetyAction.NONE, SafetyState.NORMAL, "", (1.0, 1.0), "PASSENGER_ONBOARD")),
        ([WARN], None, verdict(SafetyAction.WARN, SafetyState.DEGRADED, "WARN", (1.5, 1.0), "")),
        ([SLOW], None, verdict(SafetyAction.LIMIT, SafetyState.DEGRADED, "SLOW", (0.3, 0.8), "SLOW")),
        ([SLOW], PASSENGER, verdict(SafetyAction.LIMIT, SafetyState.DEGRADED, "SLOW", (0.3, 0.8), "SLOW")),
        ([SLOW, TURN], None, verdict(SafetyAction.LIMIT, SafetyState.DEGRADED, "SLOW TURN", (0.3, 0.2), "SLOW,TURN")),
        (
            [STOP, SLOW],
            None,
            verdict(SafetyAction.STOP, SafetyState.COLLISION_AVOIDANCE, "STOP SLOW", (0, 0), "STOP"),
        ),
        (
            [STAND, NEAR],
            None,
            verdict(SafetyAction.STOP, SafetyState.COLLISION_AVOIDANCE, "STAND NEAR", (0, 0), "STAND"),
        ),
        (
            [LOST, NEAR],
            PASSENGER,
            verdict(
                SafetyAction.STOP,
                SafetyState.COLLISION_AVOIDANCE,
                "LOCALIZATION_LOST NEAR",
                (0, 0),
                "LOCALIZATION_LOST",
            ),
        ),
        (
            [ESTOP, STOP, WARN],
            PASSENGER,
            verdict(SafetyAction.EMERGENCY_STOP, SafetyState.EMERGENCY_STOP, "ESTOP STOP WARN", (0, 0), "ESTOP,STOP"),
        ),
    ],
)
def test_verdicts(rows: list[ActiveRow], passenger: SpeedLimit | None, expected: Verdict) -> None:
    assert arbitrate(rows, OWN, passenger) == expected


@pytest.mark.parametrize(
    ("rows", "passenger", "reason"),
    [([], None, "WAY_UNSEEN"), ([], PASSENGER, "WAY_UNSEEN"), ([TURN], None, "TURN,WAY_UNSEEN")],
)
def test_a_way_into_the_unseen_limits_and_is_no_fault(
    rows: list[ActiveRow], passenger: SpeedLimit | None, reason: str
) -> None:
    now = arbitrate(rows, OWN, passenger, SpeedLimit(0.4, 0.6))
    assert (now.limit.linear_mps, now.limit.codes) == (0.4, split_codes(reason))
    assert now.faults == tuple(row.code for row in rows)


def test_undocking_is_a_limit_and_no_fault() -> None:
    now = arbitrate([], OWN, PASSENGER, None, SpeedLimit(0.15, 0.1))
    assert now == verdict(SafetyAction.NONE, SafetyState.NORMAL, "", (0.15, 0.1), "UNDOCKING")


def test_docking_is_a_limit_and_no_fault() -> None:
    now = arbitrate([], OWN, PASSENGER, docking=SpeedLimit(0.2, 0.1))
    assert now == verdict(SafetyAction.NONE, SafetyState.NORMAL, "", (0.2, 0.1), "DOCKING")
    assert arbitrate([STOP], OWN, PASSENGER, None, SpeedLimit(0.15, 0.1)).limit.codes == ("STOP",)


def test_stale_sight_is_a_limit_and_no_fault_and_at_zero_a_hard_stop() -> None:
    now = arbitrate([], OWN, PASSENGER, stale_sight=SpeedLimit(0.3, 0.2))
    assert now == verdict(SafetyAction.NONE, SafetyState.NORMAL, "", (0.3, 0.2), "SIGHT_STALE")
    now = arbitrate([], OWN, PASSENGER, stale_sight=SpeedLimit(0.0, 0.0))
    assert now == verdict(SafetyAction.NONE, SafetyState.NORMAL, "", (0.0, 0.0), "SIGHT_STALE")
    assert now.limit.is_hard_stop()
    assert not arbitrate([LOST], OWN, PASSENGER, stale_sight=SpeedLimit(0.3, 0.2)).limit.is_hard_stop()
    both = arbitrate([LOST], OWN, PASSENGER, stale_sight=SpeedLimit(0.0, 0.0)).limit
    assert (both.codes, both.is_hard_stop()) == (("LOCALIZATION_LOST", "SIGHT_STALE"), True)


def test_a_limit_without_a_number_is_a_stop() -> None:
    assert arbitrate([replace(SLOW, limit=None)], OWN, None).limit.usable() == (0.0, 0.0)


def test_limit_above_the_robots_limits_has_no_effect() -> None:
    assert arbitrate([replace(SLOW, limit=SpeedLimit(9.0, 9.0))], OWN, None).limit == SafetyLimit(1.5, 1.0)


@pytest.mark.parametrize("limit", [SpeedLimit(1.5, 0.5), SpeedLimit(0.5, 1.0)])
def test_a_limit_equal_to_the_robots_own_is_no_reason(limit: SpeedLimit) -> None:
    same = replace(SLOW, code="SAME", limit=OWN)
    tight = replace(SLOW, code="TIGHT", limit=limit)
    assert arbitrate([same], OWN, None).limit.codes == ()
    assert arbitrate([same, tight], OWN, None).limit.codes == ("TIGHT",)


def test_stop_ignores_an_attached_limit() -> None:
    assert arbitrate([replace(STOP, limit=SpeedLimit(0.7, 0.7))], OWN, None).limit.usable() == (0.0, 0.0)


def _rows() -> st.SearchStrategy[list[ActiveRow]]:
    speed = st.floats(0.0, 3.0)
    limit = st.none() | st.builds(SpeedLimit, speed, speed)
    row = st.builds(
        lambda fault, action, limit: ActiveRow(fault.code, action, fault.state, limit, ""),
        st.sampled_from(FAULTS),
        st.sampled_from([action for action in SafetyAction if action]),
        limit,
    )
    return st.lists(row, max_size=8)


@given(_rows(), _rows(), st.booleans())
def test_additional_fault_never_relaxes_the_action(
    rows: list[ActiveRow], more: list[ActiveRow], passenger: bool
) -> None:
    aboard = PASSENGER if passenger else None
    fewer, all_of_them = arbitrate(rows, OWN, aboard), arbitrate([*rows, *more], OWN, aboard)
    assert all_of_them.action >= fewer.action
    assert all_of_them.state >= fewer.state
    assert all_of_them.limit.linear_mps <= fewer.limit.linear_mps
    assert all_of_them.limit.angular_radps <= fewer.limit.angular_radps
    assert set(all_of_them.faults) >= set(fewer.faults)


@given(_rows())
def test_a_passenger_never_makes_it_faster(rows: list[ActiveRow]) -> None:
    alone, aboard = arbitrate(rows, OWN, None), arbitrate(rows, OWN, PASSENGER)
    assert aboard.limit.linear_mps <= min(alone.limit.linear_mps, PASSENGER.linear_mps)


@given(_rows())
def test_a_stop_is_hard_unless_every_row_that_stops_is_gentle(rows: list[ActiveRow]) -> None:
    verdict = arbitrate(rows, OWN, PASSENGER)
    standing = [row for row in rows if row.action >= SafetyAction.STOP or (row.limit or STANDSTILL).linear_mps == 0.0]
    standing = [row for row in standing if row.action >= SafetyAction.LIMIT]
    assert verdict.limit.is_hard_stop() == any(row.code not in ("LOCALIZATION_LOST", "SLOPE") for row in standing)


@given(_rows(), st.text())
def test_a_text_decides_nothing(rows: list[ActiveRow], detail: str) -> None:
    assert arbitrate([replace(row, detail=detail) for row in rows], OWN, PASSENGER) == arbitrate(rows, OWN, PASSENGER)


@given(_rows())
def test_stop_means_zero_and_zero_has_a_reason(rows: list[ActiveRow]) -> None:
    verdict = arbitrate(rows, OWN, None)
    if verdict.action >= SafetyAction.STOP:
        assert verdict.limit.usable() == (0.0, 0.0)
    if verdict.limit.linear_mps < OWN.linear_mps:
        assert verdict.limit.codes

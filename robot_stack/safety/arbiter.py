"""The arbiter: the most severe action of all rows in force applies, and the smallest of several limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robot_stack.contract.faults import DOCKING, PASSENGER_ONBOARD, SIGHT_STALE, UNDOCKING, WAY_UNSEEN
from robot_stack.contract.model import SafetyAction, SafetyState
from robot_stack.core.limits import STANDSTILL, SafetyLimit, SpeedLimit
from robot_stack.safety.rows import ActiveRow


@dataclass(frozen=True, slots=True)
class Verdict:
    """The permission of the drive now.

    faults: codes of all rows in force, in the order of the contract.
    """

    action: SafetyAction
    state: SafetyState
    faults: tuple[str, ...]
    limit: SafetyLimit


def arbitrate(
    rows: Sequence[ActiveRow],
    own: SpeedLimit,
    passenger: SpeedLimit | None,
    unseen: SpeedLimit | None = None,
    undocking: SpeedLimit | None = None,
    docking: SpeedLimit | None = None,
    stale_sight: SpeedLimit | None = None,
) -> Verdict:
    """The verdict on the rows in force.

    Args:
        rows: rows in force, in the order of the contract.
        own: the robot's own limits.
        passenger: limits with a passenger aboard, None without one.
        unseen: limits where the way leads into space neither seen nor remembered, None elsewhere.
        undocking: limits of undocking from a wheelchair, None at all other times.
        docking: limits while the parts of a dock are no obstacles, None at all other times.
        stale_sight: limits while the newest obstacle points are stale, None while they are fresh.
    """
    limits = [(row.code, limit) for row in rows if (limit := _limit_of(row)) is not None]
    others = (
        (PASSENGER_ONBOARD, passenger),
        (UNDOCKING, undocking),
        (DOCKING, docking),
        (WAY_UNSEEN, unseen),
        (SIGHT_STALE, stale_sight),
    )
    limits += [(reason, limit) for reason, limit in others if limit is not None]
    linear_mps = min([own.linear_mps, *(limit.linear_mps for _, limit in limits)])
    angular_radps = min([own.angular_radps, *(limit.angular_radps for _, limit in limits)])
    smallest = SpeedLimit(linear_mps, angular_radps)
    codes = tuple(code for code, limit in limits if _binds(limit, smallest, own))
    return Verdict(
        action=max((row.action for row in rows), default=SafetyAction.NONE),
        state=max((row.state for row in rows), default=SafetyState.NORMAL),
        faults=tuple(row.code for row in rows),
        limit=SafetyLimit(linear_mps, angular_radps, codes),
    )


def _binds(limit: SpeedLimit, smallest: SpeedLimit, own: SpeedLimit) -> bool:
    """True if one of the smallest speeds comes from ``limit`` and is below the robot's own."""
    return (
        limit.linear_mps == smallest.linear_mps < own.linear_mps
        or limit.angular_radps == smallest.angular_radps < own.angular_radps
    )


def _limit_of(row: ActiveRow) -> SpeedLimit | None:
    if row.action >= SafetyAction.STOP:
        return STANDSTILL
    if row.action is SafetyAction.LIMIT:
        # A limit without a value is a stop.
        return row.limit or STANDSTILL
    return None

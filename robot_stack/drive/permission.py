"""The stopping rules of the drive, strongest first.

A missing input stops the robot, and a stop overrides everything.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.limits import MotionLimits, SafetyLimit
from robot_stack.drive.arbitration import NO_COMMAND, Command, Source


class Action(Enum):
    """DRIVE: towards the command within the comfort limits (a zero command is a gentle stop). BRAKE: stop at the
    emergency deceleration. HALT: command zero at once; the engine decelerates.
    """

    DRIVE = "drive"
    BRAKE = "brake"
    HALT = "halt"


@dataclass(frozen=True, slots=True)
class Situation:
    """Inputs of one tick. speed_limit: None before the first one. passenger: the slower limits apply.
    must_rest: the source in control has not requested standstill since an emergency stop.
    """

    emergency_stop: bool
    joint_states_fresh: bool
    safety_status_fresh: bool
    speed_limit: SafetyLimit | None
    speed_limit_fresh: bool
    passenger: bool
    holder: Source | None
    requested: Command
    must_rest: bool = False


@dataclass(frozen=True, slots=True)
class Permission:
    """limits, requested: for the drive's step. ready: all inputs of the drive are present.
    reason: one short sentence."""

    action: Action
    requested: Command
    limits: MotionLimits
    ready: bool
    reason: str


def permit(situation: Situation, empty: MotionLimits, with_passenger: MotionLimits) -> Permission:
    """The strongest rule that applies."""
    limits = with_passenger if situation.passenger else empty
    limit = situation.speed_limit
    if situation.emergency_stop:
        return Permission(Action.HALT, NO_COMMAND, limits, True, "emergency stop")
    if not situation.joint_states_fresh:
        return Permission(Action.BRAKE, NO_COMMAND, limits, False, _silent(topics.JOINT_STATES))
    if limit is None:
        return Permission(Action.DRIVE, NO_COMMAND, limits, False, f"waiting for {topics.VELOCITY_LIMIT.name}")
    # Without a running monitor nothing is monitored: every metre until standstill is driven blind.
    for fresh, topic in (
        (situation.speed_limit_fresh, topics.VELOCITY_LIMIT),
        (situation.safety_status_fresh, topics.SAFETY_STATUS),
    ):
        if not fresh:
            return Permission(Action.BRAKE, NO_COMMAND, limits, False, _silent(topic))
    if limit.is_hard_stop():
        return Permission(Action.BRAKE, NO_COMMAND, limits, True, f"stop: {', '.join(limit.codes)}")
    limits = limits.slower(limit)
    holder = situation.holder
    if holder is not None and situation.must_rest:
        name = holder.name.lower()
        return Permission(
            Action.DRIVE, NO_COMMAND, limits, True, f"{name} must ask for standstill first, after the emergency stop"
        )
    return Permission(
        Action.DRIVE, situation.requested, limits, True, "idle" if holder is None else f"{holder.name.lower()} drives"
    )


def _silent(topic: Topic) -> str:
    return f"no usable {topic.name} for {topic.stale_s} s"

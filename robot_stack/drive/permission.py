"""What the drive may do now: the rules of stopping, strongest first.

Silence is a stop, and stop wins over everything.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from robot_stack.contract import topics
from robot_stack.contract.faults import BY_CODE
from robot_stack.contract.model import SafetyAction, SafetyState, Topic
from robot_stack.drive.arbitration import NO_WISH, Source, Wish
from robot_stack.drive.limits import MotionLimits


class Action(Enum):
    """DRIVE: towards the wish within the comfort limits (a zero wish is a gentle stop). BRAKE: stop at the emergency
    deceleration. HALT: command zero at once; the engine decelerates.
    """

    DRIVE = "drive"
    BRAKE = "brake"
    HALT = "halt"


@dataclass(frozen=True, slots=True)
class SpeedLimit:
    """The safety monitor's limit; ``reason`` names fault codes, joined by commas."""

    max_speed_mps: float
    max_yaw_rate_radps: float
    reason: str

    def is_hard_stop(self) -> bool:
        """True for a stop that cannot wait for comfort: something is in the way, or an emergency."""
        if self.max_speed_mps > 0.0 or self.max_yaw_rate_radps > 0.0:
            return False
        faults = [BY_CODE[code] for code in self.reason.split(",") if code in BY_CODE]
        return any(
            fault.action is SafetyAction.EMERGENCY_STOP
            or (fault.action is SafetyAction.STOP and fault.state is SafetyState.COLLISION_AVOIDANCE)
            for fault in faults
        )


@dataclass(frozen=True, slots=True)
class Situation:
    """What is known at one tick. speed_limit: None before the first one. passenger: the slower limits apply."""

    emergency_stop: bool
    joint_states_fresh: bool
    safety_status_fresh: bool
    speed_limit: SpeedLimit | None
    passenger: bool
    holder: Source | None
    wish: Wish


@dataclass(frozen=True, slots=True)
class Permission:
    """limits, wish: for the drive's step. ready: nothing that the drive needs is missing.
    reason: one short sentence."""

    action: Action
    wish: Wish
    limits: MotionLimits
    ready: bool
    reason: str


def permit(situation: Situation, empty: MotionLimits, with_passenger: MotionLimits) -> Permission:
    """The strongest rule that applies."""
    limits = with_passenger if situation.passenger else empty
    limit = situation.speed_limit
    if situation.emergency_stop:
        return Permission(Action.HALT, NO_WISH, limits, True, "emergency stop")
    if not situation.joint_states_fresh:
        return Permission(Action.BRAKE, NO_WISH, limits, False, _silent(topics.JOINT_STATES))
    if not situation.safety_status_fresh:
        return Permission(Action.DRIVE, NO_WISH, limits, False, _silent(topics.SAFETY_STATUS))
    if limit is None:
        return Permission(Action.DRIVE, NO_WISH, limits, False, f"waiting for {topics.VELOCITY_LIMIT.name}")
    if limit.is_hard_stop():
        return Permission(Action.BRAKE, NO_WISH, limits, True, f"stop: {limit.reason}")
    limits = limits.slower(limit.max_speed_mps, limit.max_yaw_rate_radps)
    holder = situation.holder
    return Permission(
        Action.DRIVE, situation.wish, limits, True, "idle" if holder is None else f"{holder.name.lower()} drives"
    )


def _silent(topic: Topic) -> str:
    return f"no usable {topic.name} for {topic.stale_s} s"

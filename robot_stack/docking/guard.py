"""Conditions monitored in every state of docking: safety, cameras, odometry, time."""

from __future__ import annotations

from robot_stack.contract.states import ALIGNING, DockingState
from robot_stack.docking.params import DockingParams
from robot_stack.docking.results import DockCode, Failure, UndockCode
from robot_stack.docking.situation import Situation

# Odometry that is silent for this many of its timeouts counts as lost.
_LOST_FACTOR = 5.0


class Guard:
    """Ends a docking or undocking whose conditions are violated. One object lasts for one job."""

    def __init__(self, params: DockingParams, *, undocking: bool) -> None:
        self._params = params
        self._undocking = undocking
        self._held_s = self._blind_s = self._lost_s = self._try_s = 0.0

    def begin_try(self) -> None:
        self._try_s = 0.0

    def check(self, situation: Situation, state: DockingState, dt_s: float) -> Failure | None:
        """The failure of the job (or, TIMEOUT, of its present try), if there is one."""
        safety, p = situation.safety, self._params
        self._count(situation, state, dt_s)
        if safety.emergency:
            return self._failure(DockCode.SAFETY_STOP, UndockCode.SAFETY_STOP, "emergency stop")
        if self._held_s > p.safety_hold_s:
            why = ", ".join(safety.faults) if safety.known else "no fresh /safety/status"
            return self._failure(DockCode.SAFETY_STOP, UndockCode.SAFETY_STOP, f"stopped by safety: {why}")
        if self._lost_s > _LOST_FACTOR * p.odometry_timeout_s:
            return self._failure(DockCode.LOCALIZATION_LOST, UndockCode.INTERNAL_ERROR, "no fresh /odom")
        if self._undocking or state not in ALIGNING:
            return None
        if state is not DockingState.SEARCH and situation.latch.known and not situation.latch.open:
            return Failure(DockCode.LATCH_FAILED, "the latch is not open before the dock", final=True)
        if "CAMERA_TIMEOUT" in safety.faults or self._blind_s > p.detections_timeout_s:
            return Failure(DockCode.CAMERA_TIMEOUT, "no new camera images", final=True)
        if self._try_s > p.try_timeout_s:
            return Failure(DockCode.TIMEOUT, f"not docked {p.try_timeout_s:.0f} s after staging")
        return None

    def _count(self, situation: Situation, state: DockingState, dt_s: float) -> None:
        seeing = state in ALIGNING
        self._try_s = self._try_s + dt_s if seeing else self._try_s
        self._held_s = self._held_s + dt_s if held(situation) else 0.0
        self._blind_s = self._blind_s + dt_s if seeing and not situation.images_fresh else 0.0
        self._lost_s = self._lost_s + dt_s if situation.odom is None else 0.0

    def _failure(self, dock: DockCode, undock: UndockCode, reason: str) -> Failure:
        return Failure(undock if self._undocking else dock, reason, final=True)


def held(situation: Situation) -> bool:
    """Safety forbids to move now."""
    return situation.safety.stopped or not situation.safety.known

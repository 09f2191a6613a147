"""A stop, from its request to standing axes, or to the report that they do not stand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robot_stack.core.goals import GoalStatus
from robot_stack.wmx.api import CoreMotionErrorCode
from robot_stack.wmx.trajectory.arm import Arm, ArmState, fault_of
from robot_stack.wmx.trajectory.dual_clock import Moment
from robot_stack.wmx.trajectory.results import Fault, Result, aborted
from robot_stack.wmx.trajectory.settings import ExecutionSettings


class Stopping:
    """Stops along the path; quick if requested, or if that was rejected or timed out. ``ending``: the result then."""

    def __init__(
        self, arm: Arm, settings: ExecutionSettings, ending: Result, now: Moment, *, quick: bool, own_s: float
    ) -> None:
        """own_s: duration of the spline's own stop; a gentle one is stopped gently."""
        self.ending = ending
        self._own_s = own_s
        self._arm, self._settings = arm, settings
        self._begin, self._quick_begin = now, now
        self._quick = False
        self._stands_since: Moment | None = None
        self._problem = ""
        if not quick:
            self._problem = _text(arm.stop())
        if quick or self._problem:
            self.hurry(now)

    def hurry(self, now: Moment) -> None:
        """Requests the quick stop, once."""
        if not self._quick:
            self._quick, self._quick_begin = True, now
            self._problem += _text(self._arm.quick_stop())

    def replace(self, ending: Result) -> None:
        """Changes the result of a cancellation that is not complete yet to a fault; any other result stays."""
        if self.ending.outcome is GoalStatus.CANCELED:
            self.ending = ending

    def look(self, now: Moment, state: ArmState) -> Result | None:
        """The result once the axes stand or their timeout has expired, else None."""
        fault = fault_of(state, self._settings.joints)
        if fault is not None:
            self.replace(aborted(Fault(fault.code, f"{self.ending.text}; while stopping: {fault.text}")))
        taken_s = now.since(self._begin)
        if not state.communicating:
            return self.ending
        if self._standing(state):
            return self._stood(now)
        self._stands_since = None
        if not self._quick and taken_s > self._own_s + self._settings.watch.stop_timeout_s:
            self.hurry(now)
        elif self._quick and now.since(self._quick_begin) > self._settings.watch.quick_stop_timeout_s:
            return self._failed(state, taken_s)
        return None

    def _stood(self, now: Moment) -> Result | None:
        """Requires standstill for some time, because a joint that swings back rests only for a moment."""
        since = self._stands_since = self._stands_since or now
        if now.since(since) < self._settings.watch.standstill_s:
            return None
        return replace(self.ending, text=f"{self.ending.text}; stood {1e3 * since.since(self._begin):.0f} ms later")

    def _failed(self, state: ArmState, taken_s: float) -> Result:
        axis = int(np.argmax(np.abs(state.velocity)))
        text = (
            f"{self.ending.text}; STOP FAILED: {self._settings.joints[axis]} moves at "
            f"{state.velocity[axis]:+.3f} rad/s {taken_s:.2f} s later{self._problem}"
        )
        return aborted(Fault(CoreMotionErrorCode.WaitTimeout, text))

    def _standing(self, state: ArmState) -> bool:
        return bool(state.idle.all() and (np.abs(state.velocity) <= self._settings.watch.standstill_radps).all())


def _text(problem: Fault | None) -> str:
    return "" if problem is None else f" ({problem.text})"

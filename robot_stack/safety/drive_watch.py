"""Judges the drives by the history of the motion engine's status (fault DRIVE_FAULT).

The drives count as up once the engine has communicated, with every axis on and without an alarm, for
``startup_settle_s`` without a break while every critical process was present: a machine under start-up load stutters.
From then on:

- no new engine cycle, or an engine that does not communicate, for more than ``silence_s`` is a fault;
- an amplifier alarm or a following error is a fault at once;
- an axis that is off is a fault after ``servo_off_s``, unless an emergency stop is latched: then it may have been
  switched off on purpose.

Before the drives have been up for the first time all of these are WAITING for ``startup_grace_s`` instead, and after
a release the servos have ``servo_on_timeout_s`` to come back on. WAITING stops the robot but latches nothing.
"""

from __future__ import annotations

from collections.abc import Callable

from robot_stack.contract.frames import JOINTS
from robot_stack.contract.model import SafetyAction
from robot_stack.safety.inputs import CLEAR, UNKNOWN, Axis, DriveReading, Finding, Level
from robot_stack.safety.timing import Hold, age_s

AXES = len(JOINTS)


class DriveWatch:
    """Tracks the engine's status; ``now_s`` are steady seconds."""

    def __init__(
        self,
        *,
        silence_s: float,
        servo_off_s: float,
        servo_on_timeout_s: float,
        startup_grace_s: float,
        startup_settle_s: float,
        now_s: float,
    ) -> None:
        self._silence_s = silence_s
        self._servo_off_s = servo_off_s
        self._servo_on_timeout_s = servo_on_timeout_s
        self._startup_settle_s = startup_settle_s
        self._first_time = True
        self._waiting_since_s: float | None = now_s
        self._may_wait_s = startup_grace_s
        self._alive_s: float | None = None
        self._cycle: int | None = None
        self._axes: tuple[Axis, ...] = ()
        self._off = Hold()
        self._good = Hold()

    def received(self, reading: DriveReading | None, now_s: float) -> None:
        """The engine's present status; None if it cannot be read."""
        if reading is None or len(reading.axes) < AXES:
            return
        # The first reading only gives the counter's value: the page of a dead engine never changes.
        if reading.communicating and self._cycle is not None and reading.cycle != self._cycle:
            self._alive_s = now_s
        self._cycle, self._axes = reading.cycle, reading.axes[:AXES]

    def released(self, now_s: float) -> None:
        """The emergency stop has been released: axes that are off may now come back on."""
        self._waiting_since_s, self._may_wait_s = now_s, self._servo_on_timeout_s

    def judge(self, emergency: bool, complete: bool, now_s: float) -> Finding:
        """The finding on the drives now.

        Args:
            emergency: an emergency stop is latched or requested.
            complete: every critical process has sent a heartbeat.
        """
        broken = self._broken(now_s)
        off = self._axes_with(lambda axis: not axis.servo_on, "servo off")
        off_for_s = self._off.update(bool(off), now_s)
        good = not broken and off_for_s is None
        good_for_s = self._good.update(good and (complete or not self._first_time), now_s)
        waiting = age_s(now_s, self._waiting_since_s) <= self._may_wait_s
        if broken:
            return _waiting(broken) if waiting and self._first_time else _fault(broken)
        if good:
            return self._good_for(good_for_s)
        if emergency:
            return CLEAR
        if waiting:
            return _waiting(off)
        return _fault(off) if off_for_s is not None and off_for_s > self._servo_off_s else UNKNOWN

    def _good_for(self, seconds: float | None) -> Finding:
        if self._first_time and (seconds is None or not seconds >= self._startup_settle_s):
            return _waiting("settling")
        self._first_time, self._waiting_since_s = False, None
        return CLEAR

    def _broken(self, now_s: float) -> str:
        if not age_s(now_s, self._alive_s) <= self._silence_s:
            return "the motion engine does not communicate"
        alarms = self._axes_with(lambda axis: axis.amp_alarm, "amplifier alarm")
        return alarms or self._axes_with(lambda axis: axis.following_error, "following error")

    def _axes_with(self, wrong: Callable[[Axis], bool], what: str) -> str:
        names = [JOINTS[index] for index, axis in enumerate(self._axes) if wrong(axis)]
        return f"{what}: {', '.join(names)}" if names else ""


def _waiting(detail: str) -> Finding:
    return Finding(Level.WAITING, SafetyAction.STOP, detail=detail)


def _fault(detail: str) -> Finding:
    return Finding(Level.PRESENT, SafetyAction.EMERGENCY_STOP, detail=detail)

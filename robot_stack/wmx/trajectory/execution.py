"""One goal from its start to standstill. It always ends: each phase has a timeout.

WAITING (for its start) -> RUNNING (the engine follows the spline) -> SETTLING (the joints come within the goal's
tolerance). A cancellation, a newer goal, a violated tolerance, a fault or a timeout leads to STOPPING,
from where a goal ends when the axes stand, or do not stand after two stop requests.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.api import CoreMotionErrorCode
from robot_stack.wmx.trajectory.arm import Arm, ArmState, Blind, end_fault, fault_of, not_ready
from robot_stack.wmx.trajectory.dual_clock import Moment
from robot_stack.wmx.trajectory.goal import CheckedGoal
from robot_stack.wmx.trajectory.plan import plan_spline
from robot_stack.wmx.trajectory.results import Fault, GoalCode, GoalRefused, Result, aborted, succeeded
from robot_stack.wmx.trajectory.settings import ExecutionSettings
from robot_stack.wmx.trajectory.spline import ClampedSpline
from robot_stack.wmx.trajectory.stopping import Stopping
from robot_stack.wmx.trajectory.tolerances import violation

FloatArray = NDArray[np.float64]

# The motion begins a few cycles after the status of its planning; the start delay is at most this.
_LONGEST_START_S = 0.02
_SLOWEST_SEEN_RADPS = 1e-3
_AT_END_RAD = 1e-4  # far above an encoder count, far below any tolerance


class Phase(Enum):
    WAITING = "waiting for its start"
    RUNNING = "running"
    SETTLING = "settling"
    STOPPING = "stopping"


@dataclass(frozen=True, slots=True)
class Sample:
    """Desired against actual, (joints,) in the order of the axes. time_s: in the trajectory of the goal."""

    time_s: float
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    actual_position: FloatArray
    actual_velocity: FloatArray


class Execution:
    """Times are steady seconds."""

    def __init__(self, goal: CheckedGoal, arm: Arm, settings: ExecutionSettings, now_s: float) -> None:
        self.goal = goal
        self.phase = Phase.WAITING
        self.sample: Sample | None = None
        self._arm, self._settings = arm, settings
        self._result: Result | None = None
        self._start_at_s = now_s + goal.start_in_s
        self._now = Moment(self._start_at_s, 0.0)  # time of the last status
        self._spline = ClampedSpline(np.array([0.0, 1.0]), np.zeros((2, len(settings.joints))))
        self._began = self._settling_since = self._now
        self._delay_s = 0.0
        self._moved = False
        self._stopping: Stopping | None = None

    def tick(self, now_s: float, status: ArmState | Blind) -> Result | None:
        """Reads the arm's state and executes the next action. Returns the result once the goal has ended."""
        if self._result is None:
            if isinstance(status, Blind):
                self._blind(now_s, status)
            elif self.phase is not Phase.WAITING or now_s >= self._start_at_s:
                self._now = Moment(now_s, status.time_s)
                self._look(status)
        return self._result

    def place_at(self, then_s: float, state: ArmState) -> FloatArray:
        """The commanded position of the joints at ``then_s``, (joints,) rad, without further requests."""
        if self.phase is not Phase.RUNNING:
            return state.command
        return self._spline.evaluate(then_s - self._began.steady_s)[0]

    def stop(self, now_s: float, ending: Result, *, quick: bool = False) -> None:
        """Ends the goal with ``ending``, once the axes stand. A stop can become a quick one, never the reverse."""
        if self._result is not None:
            return
        if self.phase is Phase.WAITING:
            self._result = ending
            return
        now = Moment(now_s, self._now.engine_s)
        if self._stopping is None:
            self.phase = Phase.STOPPING
            own_s = self._spline.longest_stop_s()
            self._stopping = Stopping(self._arm, self._settings, ending, now, quick=quick, own_s=own_s)
        elif quick:
            self._stopping.replace(ending)
            self._stopping.hurry(now)

    # --- phases ------------------------------------------------------------------------------------------------------

    def _look(self, state: ArmState) -> None:
        match self.phase:
            case Phase.WAITING:
                self._begin(state)
            case Phase.RUNNING:
                self._run(state)
            case Phase.SETTLING:
                self._settle(state)
            case Phase.STOPPING:
                self._stand(state)

    def _begin(self, state: ArmState) -> None:
        if not len(self.goal.points):
            self._result = succeeded("the trajectory has no points: nothing to do")
            return
        fault = not_ready(state, self._settings.joints)
        if fault is not None:
            self._result = aborted(fault)
            return
        try:
            spline = plan_spline(
                self.goal.points, self.goal.late_s, state.command, self._settings.joints, self._settings.plan
            )
        except GoalRefused as refusal:
            self._result = aborted(refusal.fault)
            return
        if spline is None:
            self._result = succeeded("already there: nothing to do")
            return
        fault = self._arm.start(spline)
        if fault is not None:
            self._result = aborted(fault)
            return
        self._spline, self.phase = spline, Phase.RUNNING
        self._began = self._now

    def _run(self, state: ArmState) -> None:
        sample = self._compare(state)
        fault = fault_of(state, self._settings.joints)
        if fault is not None:
            self._stop_for(fault, state)
            return
        outside = self._outside(sample)
        idle = bool(state.idle.all())
        self._moved = self._moved or not idle
        if outside:
            self._stop(aborted(Fault(GoalCode.PATH_TOLERANCE_VIOLATED, f"path tolerance: {outside}")))
        elif idle and self._complete(state):
            self.phase, self._settling_since = Phase.SETTLING, self._now
            self._settle(state)
        elif idle and not state.complete.all() and self._had_time_to_start():
            self._stop_for(end_fault(state, self._settings.joints), state)
        elif self._late_s > self._settings.watch.end_timeout_s:
            fault = Fault(CoreMotionErrorCode.WaitTimeout, f"still moving {self._late_s:.2f} s too late")
            self._stop(aborted(fault))

    @property
    def _late_s(self) -> float:
        return self._now.since(self._began) - self._spline.duration_s

    def _settle(self, state: ArmState) -> None:
        fault = fault_of(state, self._settings.joints)
        if fault is not None:
            self._stop_for(fault, state)
            return
        sample = self._compare(state)
        outside = violation(
            self.goal.at_goal,
            sample.position - sample.actual_position,
            sample.velocity - sample.actual_velocity,
            self._settings.joints,
        )
        if not outside:
            self._result = succeeded("")
        elif self._now.since(self._settling_since) > self.goal.goal_time_s:
            text = f"goal tolerance, {self.goal.goal_time_s:g} s after the end: {outside}"
            self._result = aborted(Fault(GoalCode.GOAL_TOLERANCE_VIOLATED, text))

    def _stand(self, state: ArmState) -> None:
        assert self._stopping is not None
        self._compare(state)
        self._result = self._stopping.look(self._now, state)

    def _blind(self, now_s: float, blind: Blind) -> None:
        """Handles a missing status: a goal that has not begun waits until it is due."""
        if now_s < self._start_at_s and self.phase is Phase.WAITING:
            return
        if blind.gone or now_s - self._now.steady_s > self._settings.watch.status_timeout_s:
            if self.phase is not Phase.WAITING and not blind.gone:
                self._arm.quick_stop()  # an engine without a status may still accept requests
            before = f"{self._stopping.ending.text}; " if self._stopping is not None else ""
            self._result = aborted(Fault(blind.fault.code, f"{before}{blind.fault.text}"))

    # --- details -----------------------------------------------------------------------------------------------------

    def _compare(self, state: ArmState) -> Sample:
        """The sample of this moment. During a stop, the engine's command is the desired state."""
        time_s = self._path_s(state)
        position, velocity, acceleration = self._spline.evaluate(time_s)
        if self.phase is Phase.STOPPING:
            position, velocity, acceleration = state.command, state.command_velocity, np.zeros_like(velocity)
        else:
            self._learn_delay(state.command - position, velocity)
        in_goal_s = self.goal.late_s + time_s * self._settings.plan.speed_scaling
        self.sample = Sample(in_goal_s, position, velocity, acceleration, state.position, state.velocity)
        return self.sample

    def _path_s(self, state: ArmState) -> float:
        """Time along the spline so far."""
        return state.time_s - self._began.engine_s - self._delay_s

    def _learn_delay(self, ahead: FloatArray, velocity: FloatArray) -> None:
        """Estimates the start of the motion from the engine's command: one Newton step of a least squares fit."""
        weight = float(velocity @ velocity)
        if weight > _SLOWEST_SEEN_RADPS**2:
            self._delay_s = min(max(0.0, self._delay_s - float(ahead @ velocity) / weight), _LONGEST_START_S)

    def _outside(self, sample: Sample) -> str:
        return violation(
            self.goal.path,
            sample.position - sample.actual_position,
            sample.velocity - sample.actual_velocity,
            self._settings.joints,
        )

    def _complete(self, state: ArmState) -> bool:
        """True if the motion is complete: the flag alone may be that of the previous motion."""
        time_s = self._path_s(state)
        left = np.abs(state.command - self._spline.positions[-1]).max()
        return bool(state.complete.all() and time_s >= self._spline.duration_s and left <= _AT_END_RAD)

    def _had_time_to_start(self) -> bool:
        return self._moved or self._now.since(self._began) > self._settings.watch.start_timeout_s

    def _stop(self, ending: Result, *, quick: bool = False) -> None:
        self.stop(self._now.steady_s, ending, quick=quick)

    def _stop_for(self, fault: Fault, state: ArmState) -> None:
        """Handles a fault in motion: stops the axes if the engine can be reached."""
        at_s = min(max(0.0, state.time_s - self._began.engine_s), self._spline.duration_s)
        text = f"{fault.text}, {at_s:.3f} s into a motion of {self._spline.duration_s:.3f} s"
        self._stop(aborted(Fault(fault.code, text)), quick=True)
        self._stand(state)

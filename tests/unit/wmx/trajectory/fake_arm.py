"""An arm of two joints in fake time: it follows splines, stops on request, and fails as a test requires."""

from __future__ import annotations

import numpy as np

from robot_stack.wmx.trajectory.arm import ArmState
from robot_stack.wmx.trajectory.goal import CheckedGoal
from robot_stack.wmx.trajectory.params import SplineParams, WatchParams
from robot_stack.wmx.trajectory.plan import PlanLimits
from robot_stack.wmx.trajectory.results import Fault
from robot_stack.wmx.trajectory.settings import ExecutionSettings
from robot_stack.wmx.trajectory.spline import ClampedSpline
from robot_stack.wmx.trajectory.tolerances import Tolerances
from robot_stack.wmx.trajectory.waypoints import Waypoints

JOINTS = ("shoulder", "elbow")
TICK_S = 0.005
NO_LIMITS = PlanLimits(
    same_position_rad=1e-3,
    max_start_deviation_rad=0.0,
    max_velocity_radps=(0.0, 0.0),
    max_acceleration_radps2=(0.0, 0.0),
    catch_up_ratio=1.5,
    catch_up_acceleration_radps2=1.0,
    near=SplineParams(max_deviation_rad=1e-4, max_deviation_radps=0.02, max_points=4000),
    speed_scaling=1.0,
    continuous=(),
)
SETTINGS = ExecutionSettings(
    joints=JOINTS,
    plan=NO_LIMITS,
    watch=WatchParams(
        start_timeout_s=0.2,
        end_timeout_s=1.0,
        status_timeout_s=0.2,
        standstill_radps=0.01,
        standstill_s=0.0,
        stop_timeout_s=0.5,
        quick_stop_timeout_s=0.3,
    ),
)


def goal(
    *waypoints: tuple[float, tuple[float, float]],
    start_in_s: float = 0.0,
    late_s: float = 0.0,
    path: Tolerances | None = None,
    at_goal: Tolerances | None = None,
    goal_time_s: float = 0.5,
) -> CheckedGoal:
    """Returns a goal. Waypoints are (time, (shoulder, elbow))."""
    return CheckedGoal(
        points=Waypoints(
            np.array([time_s for time_s, _ in waypoints], float),
            np.array([position for _, position in waypoints], float).reshape(-1, 2),
        ),
        order=(0, 1),
        start_in_s=start_in_s,
        late_s=late_s,
        path=path or Tolerances.none(2),
        at_goal=at_goal or Tolerances.none(2),
        goal_time_s=goal_time_s,
    )


class FakeArm:
    """offset: distance of the joints from their commands. stop_takes_s: None for never. start_takes_s: delay until a
    started motion moves. cut_at_s: when the engine ends the motion by itself.
    """

    def __init__(self) -> None:
        self.time_s = 10.0
        self.command = np.zeros(2)
        self.offset = np.zeros(2)
        self.refusal: Fault | None = None
        self.stop_refusal: Fault | None = None
        self.stop_takes_s: float | None = 0.1
        self.quick_stop_takes_s: float | None = 0.02
        self.start_takes_s = 0.001
        self.cut_at_s = np.inf
        self.hangs = False
        self.swing_radps = 0.0
        self.communicating = True
        self.emergency_stop = False
        self.servo_on = np.ones(2, bool)
        self.alarm_code = np.zeros(2, np.int64)
        self.following_error = np.zeros(2, bool)
        self.end_reason = np.zeros(2, np.int64)
        self.position_mode = np.ones(2, bool)
        self.foreign_motion = np.zeros(2, bool)
        self.complete = np.zeros(2, bool)
        self.calls: list[str] = []
        self.splines: list[ClampedSpline] = []
        self._spline: ClampedSpline | None = None
        self._began_s = 0.0
        self._stops_at_s = np.inf
        self._stop_began_s = 0.0

    def start(self, spline: ClampedSpline) -> Fault | None:
        self.calls.append("start")
        if self.refusal is not None:
            return self.refusal
        assert np.array_equal(spline.positions[0], self.command), "a spline must start where the arm is"
        self.splines.append(spline)
        self._spline, self._began_s, self._stops_at_s = spline, self.time_s + self.start_takes_s, np.inf
        self.complete[:] = False
        return None

    def stop(self) -> Fault | None:
        self.calls.append("stop")
        if self.stop_refusal is None:
            self._stop_in(self.stop_takes_s)
        return self.stop_refusal

    def quick_stop(self) -> Fault | None:
        self.calls.append("quick_stop")
        self._stop_in(self.quick_stop_takes_s)
        return None

    def _stop_in(self, takes_s: float | None) -> None:
        if takes_s is not None and self._spline is not None:
            self._stops_at_s = min(self._stops_at_s, self.time_s + takes_s)

    def advance(self, seconds: float = TICK_S) -> None:
        self.time_s += seconds
        if self._spline is None:
            return
        moved_s = self.time_s - self._began_s
        if self.time_s >= self._stops_at_s or moved_s >= self.cut_at_s:
            self._spline = None
        elif moved_s > 0.0:
            self.command = self._spline.evaluate(moved_s)[0]
            if moved_s >= self._spline.duration_s and not self.hangs:
                self._spline = None
                self.complete[:] = True

    def state(self) -> ArmState:
        velocity = np.zeros(2)
        moving = self._spline is not None and self.time_s > self._began_s
        if moving:
            assert self._spline is not None
            velocity = self._spline.evaluate(self.time_s - self._began_s)[1]
        return ArmState(
            time_s=self.time_s,
            communicating=self.communicating,
            emergency_stop=self.emergency_stop,
            command=self.command.copy(),
            position=self.command + self.offset,
            command_velocity=velocity,
            velocity=velocity + self.swing_radps,
            idle=np.full(2, not moving) & ~self.foreign_motion,
            complete=self.complete.copy(),
            position_mode=self.position_mode.copy(),
            servo_on=self.servo_on.copy(),
            alarm=self.alarm_code != 0,
            alarm_code=self.alarm_code.copy(),
            following_error=self.following_error.copy(),
            end_reason=self.end_reason.copy(),
        )

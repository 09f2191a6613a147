"""One try to reach one waypoint: arrival and progress.

All times are sums of tick steps, so that a clock jump neither ends a wait nor fails a try.
"""

from __future__ import annotations

import math

from robot_stack.core.geometry import Pose2
from robot_stack.core.mission import Waypoint
from robot_stack.mission import route
from robot_stack.mission.events import Inputs
from robot_stack.mission.params import MissionParams

_NEW_PLAN_M = 0.5


class Leg:
    """Volatile state of the current try; a new one is made whenever the mission manager changes its state."""

    __slots__ = (
        "_best_m",
        "_params",
        "_recoveries",
        "_remaining_m",
        "at_door",
        "goal_due",
        "settled_s",
        "stalled_s",
        "waited_s",
    )

    def __init__(self, params: MissionParams, *, goal_due: bool = False) -> None:
        self._params = params
        self._best_m, self._remaining_m = math.inf, math.nan
        self._recoveries = 0
        self.settled_s = -1.0
        self.stalled_s = 0.0
        self.waited_s = 0.0
        self.goal_due = goal_due
        # The robot waits for a door, or has not moved since it was opened.
        self.at_door = False

    def arrived(self, inputs: Inputs, stops: tuple[Waypoint, ...], index: int, dt_s: float) -> bool:
        """True once the waypoint is reached: passed, or stood at for settle_s. Call once a tick with a known pose."""
        assert inputs.pose is not None
        if not route.at_waypoint(inputs.pose, stops, index, self._params):
            self.settled_s = -1.0
            return False
        if not route.must_stand(stops, index):
            return True
        if not route.standing(inputs.twist, self._params):
            self.settled_s = -1.0
            return False
        # The first tick at standstill starts the time: the state before that tick is unknown.
        self.settled_s = 0.0 if self.settled_s < 0.0 else self.settled_s + dt_s
        return self.settled_s >= self._params.settle_s

    def stalls(self, pose: Pose2, goal: Pose2, distance_m: float, recoveries: int, dt_s: float) -> bool:
        """True once the robot has not come nearer, along its plan, for progress_timeout_s. Call only while it may
        move. distance_m: length left of the plan, NaN if unknown. recoveries: of navigation; each, of which navigation
        limits the number, starts the time again, because the robot makes room for a person instead of coming nearer.
        """
        if recoveries > self._recoveries:
            self.stalled_s = 0.0
        self._recoveries = recoveries
        remaining_m = route.effort_m(pose, goal, distance_m, self._params)
        if abs(remaining_m - self._remaining_m) > _NEW_PLAN_M:
            # A larger step than the robot can move is a new plan or pose: neither progress nor loss.
            self._best_m += remaining_m - self._remaining_m
        self._remaining_m = remaining_m
        if remaining_m < self._best_m - self._params.progress_min_m:
            self._best_m, self.stalled_s = remaining_m, 0.0
            return False
        self.stalled_s += dt_s
        return self.stalled_s >= self._params.progress_timeout_s

"""Goals of the navigation controller: one at a time, each with a number.

Arrival is not decided here: the mission manager compares the robot's pose with the waypoint. A goal that ends before is
sent again, and the robot's progress decides whether the try has failed.
"""

from __future__ import annotations

import math

from robot_stack.core.geometry import Pose2
from robot_stack.mission.events import (
    NavigationAborted,
    NavigationAccepted,
    NavigationEvent,
    NavigationFeedback,
    NavigationLost,
    SendGoal,
)
from robot_stack.mission.params import MissionParams

SERVER = "navigation_controller"


class NavigationCalls:
    """The newest goal.

    distance_m: along the plan to the goal, NaN before the first feedback. problem: why navigation aborted it.
    """

    def __init__(self, params: MissionParams) -> None:
        self._params = params
        self._number = 0
        self._again_in_s = math.inf
        self._planned_s = 0.0
        self.distance_m = math.nan
        self.problem = ""

    def send(self, pose: Pose2) -> SendGoal:
        self._number += 1
        self._again_in_s, self.distance_m, self.problem = math.inf, math.nan, ""
        return SendGoal(self._number, pose)

    def on_event(self, event: NavigationEvent) -> None:
        """Handles an event of the newest goal; those of earlier goals are ignored."""
        if event.call != self._number:
            return
        match event:
            case NavigationAccepted():
                pass
            case NavigationFeedback(_, distance_m):
                self.distance_m = distance_m if math.isfinite(distance_m) else math.nan
            case NavigationLost():
                self._again_in_s = 0.0
            case _:
                self._again_in_s = self._params.goal_retry_s
                if isinstance(event, NavigationAborted):
                    self.problem = f"{event.reason} (error {event.code})" if event.code else event.reason

    def due_again(self, dt_s: float) -> bool:
        """True once the goal has ended and the pause after it is over. Call only while the goal is wanted."""
        self._again_in_s -= dt_s
        return self._again_in_s <= 0.0

    def unwanted(self, planned: bool, dt_s: float) -> bool:
        """True every goal_retry_s for as long as navigation has a plan. Call only while it should have none."""
        self._planned_s = self._planned_s + dt_s if planned else 0.0
        if self._planned_s < self._params.goal_retry_s:
            return False
        self._planned_s = 0.0
        return True

"""Goals of actions: how they end, and a client's goals of navigate_to_pose.

Arrival is not decided here: the client compares the robot's pose with its goal. A goal that ends before is sent again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from robot_stack.core.geometry import Pose2
from robot_stack.core.limits import NO_LIMIT, SpeedLimit

NAVIGATION = "navigation_controller"


class GoalStatus(Enum):
    """How a goal ended.

    Only for clients: REJECTED; UNKNOWN, if the server does not have it: it restarted, is gone, or did not receive it.
    """

    UNKNOWN = "unknown"
    REJECTED = "rejected"
    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELED = "canceled"


@dataclass(frozen=True, slots=True)
class SendGoal:
    """A goal for the navigation controller. call: number of this goal, repeated in its events. pose: in map.

    limit: on the way to it.
    """

    call: int
    pose: Pose2
    limit: SpeedLimit = NO_LIMIT


@dataclass(frozen=True, slots=True)
class NavigationFeedback:
    """distance_m: along the plan to the goal. recoveries: such as giving way, since its acceptance."""

    call: int
    distance_m: float
    recoveries: int = 0


@dataclass(frozen=True, slots=True)
class NavigationEnded:
    """code: of nav2_msgs, for an aborted goal; 0 if another goal preempted it. reason: in words."""

    call: int
    status: GoalStatus
    code: int = 0
    reason: str = ""


NavigationEvent = NavigationFeedback | NavigationEnded


class NavigationGoals:
    """The newest goal of one client. Times are sums of the ticks' steps.

    retry_s: after which an ended goal may be sent again, and a cancellation repeated.
    distance_m: along the plan to the goal, NaN before the first feedback.
    aborted: navigation gave up the goal, not for another one. problem: why navigation aborted it.
    recoveries: of the goal so far.
    """

    def __init__(self, retry_s: float) -> None:
        self._retry_s = retry_s
        self._number = 0
        self._open = False  # the goal was sent and has not ended
        self._again_in_s = math.inf
        self._cancel_in_s = 0.0
        self.distance_m = math.nan
        self.recoveries = 0
        self.aborted = False
        self.problem = ""

    def send(self, pose: Pose2, limit: SpeedLimit = NO_LIMIT) -> SendGoal:
        """A new goal, which preempts the one before."""
        self._number += 1
        self._open, self._again_in_s, self._cancel_in_s = True, math.inf, 0.0
        self.distance_m, self.recoveries, self.aborted, self.problem = math.nan, 0, False, ""
        return SendGoal(self._number, pose, limit)

    def on_event(self, event: NavigationEvent) -> None:
        """Handles an event of the newest goal; those of earlier goals are ignored."""
        if event.call != self._number:
            return
        if isinstance(event, NavigationFeedback):
            self.recoveries = event.recoveries
            self.distance_m = event.distance_m if math.isfinite(event.distance_m) else math.nan
            return
        self._open = False
        self._again_in_s = 0.0 if event.status is GoalStatus.UNKNOWN else self._retry_s
        if event.status is GoalStatus.ABORTED:
            self.aborted = bool(event.code)
            self.problem = f"{event.reason} (error {event.code})" if event.code else event.reason

    def due_again(self, dt_s: float) -> bool:
        """True once the goal has ended and the pause after it is over. Call only while the goal is wanted."""
        self._again_in_s -= dt_s
        return self._again_in_s <= 0.0

    def must_cancel(self, dt_s: float) -> bool:
        """True at once and then every retry_s until the goal has ended. Call only while no goal is wanted."""
        if not self._open:
            return False
        self._cancel_in_s -= dt_s
        if self._cancel_in_s > 0.0:
            return False
        self._cancel_in_s = self._retry_s
        return True

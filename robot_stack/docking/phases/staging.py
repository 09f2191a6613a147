"""To the staging pose: by navigation the first time, straight back from the dock after a failed try."""

from __future__ import annotations

import math

from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.core.goals import NAVIGATION, NavigationGoals
from robot_stack.docking.motion import Follower, Point, from_base, straight_to
from robot_stack.docking.params import MotionParams, StagingParams
from robot_stack.docking.results import DockCode, Failure
from robot_stack.docking.situation import Step, View
from robot_stack.docking.states import Trigger


class DriveToStaging:
    """Navigation drives; this phase sends the goal and checks arrival by the pose in map.

    only: nothing follows at the staging pose. elsewhere: there is another one to drive to if navigation gives up.
    """

    def __init__(
        self, staging: Pose2, goals: NavigationGoals, params: StagingParams, *, only: bool, elsewhere: bool
    ) -> None:
        self._staging, self._goals = staging, goals
        self._params = params
        self._done = Trigger.STAGED_ONLY if only else Trigger.STAGED
        self._elsewhere = elsewhere
        self._elapsed_s = 0.0
        self._lost_s = 0.0
        self._goal_due = True

    def tick(self, view: View) -> Step:
        self._elapsed_s += view.dt_s
        self._goal_due = self._goal_due or self._goals.due_again(view.dt_s)
        pose = view.situation.located
        self._lost_s = 0.0 if pose is not None else self._lost_s + view.dt_s
        if self._lost_s > self._params.no_pose_s:
            return _failed(Failure(DockCode.LOCALIZATION_LOST, "no /current_pose on the way to staging", final=True))
        if self._elapsed_s > self._params.timeout_s:
            why = f"; navigation: {self._goals.problem}" if self._goals.problem else ""
            text = f"not at staging after {self._params.timeout_s:.0f} s{why}"
            return _failed(Failure(DockCode.STAGING_FAILED, text))
        if pose is not None and self._arrived(pose) and _standing(view.situation.twist, self._params):
            return Step("at staging", trigger=self._done)
        if self._elsewhere and not self._goal_due and self._goals.aborted:
            text = f"no way to this staging pose; navigation: {self._goals.problem}"
            return _failed(Failure(DockCode.STAGING_FAILED, text, elsewhere=True))
        if not self._goal_due:
            return Step("driving to staging")
        if not view.situation.navigation_served:
            return Step(f"waiting for {NAVIGATION}")
        self._goal_due = False
        return Step("driving to staging", goal=self._goals.send(self._staging))

    def _arrived(self, pose: Pose2) -> bool:
        off = self._staging.relative_to(pose)
        return math.hypot(off.x, off.y) <= self._params.arrival_m and abs(off.yaw) <= self._params.arrival_rad


class BackToStaging:
    """Backs along the dock's axis by odometry, in the frame of the dock pose estimated at the start."""

    def __init__(self, dock_pose_in_odom: Pose2, staging: StagingParams, motion: MotionParams) -> None:
        self._frame = dock_pose_in_odom
        self._staging, self._motion = staging, motion
        self._follower: Follower | None = None
        self._elapsed_s = 0.0

    def tick(self, view: View) -> Step:
        self._elapsed_s += view.dt_s
        odom = view.situation.odom
        if self._elapsed_s > self._staging.timeout_s:
            return _failed(
                Failure(DockCode.STAGING_FAILED, f"not back at staging after {self._staging.timeout_s:.0f} s")
            )
        if odom is None:
            return Step("waiting for odometry", ZERO_TWIST)
        pose = odom.relative_to(self._frame)
        if self._follower is None:
            goal = Pose2(-view.approach_sign * self._staging.distance_m, 0.0, 0.0)
            start = Point(pose, from_base(view.commanded, pose.yaw))
            self._follower = Follower(straight_to(start, goal, self._motion), self._motion)
        twist = self._follower.step(pose, view.dt_s)
        if self._follower.finished:
            return Step("back at staging", ZERO_TWIST, Trigger.STAGED)
        return Step("backing off to staging", twist)


def _standing(twist: Twist2 | None, params: StagingParams) -> bool:
    return twist is not None and twist.speed() <= params.standing_mps and abs(twist.omega) <= params.standing_radps


def _failed(failure: Failure) -> Step:
    return Step(failure.reason, trigger=Trigger.TRY_FAILED, failure=failure)

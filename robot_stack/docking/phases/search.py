"""Search for the dock's markers: first straight ahead, then all around, not beside the dock."""

from __future__ import annotations

import math

from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.docking.motion import Follower, Point, from_base, straight_to
from robot_stack.docking.params import MotionParams, SearchParams
from robot_stack.docking.results import DockCode, Failure
from robot_stack.docking.situation import Step, View
from robot_stack.docking.states import Trigger


class Search:
    """last_dock_pose: last estimate of the docked base_link in odom; None without a sighting."""

    def __init__(self, last_dock_pose: Pose2 | None, search: SearchParams, motion: MotionParams) -> None:
        self._frame = last_dock_pose
        self._params, self._motion = search, motion
        self._follower: Follower | None = None
        self._looked_s = 0.0
        self._turning_s = 0.0
        self._turned_rad = 0.0

    def tick(self, view: View) -> Step:
        if len(view.sightings) >= self._params.sightings:
            return Step("markers found", ZERO_TWIST, Trigger.FOUND)
        self._looked_s += view.dt_s
        odom, twist = view.situation.odom, view.situation.twist
        if odom is None or twist is None:
            return Step("waiting for odometry", ZERO_TWIST)
        if self._looked_s <= self._params.look_s:
            return Step("looking for markers", ZERO_TWIST)
        backing = self._back_off(view, odom)
        return backing or self._turn(view, twist)

    def _back_off(self, view: View, odom: Pose2) -> Step | None:
        """Backs off from the dock before turning: beside it the robot's corners would hit it."""
        if self._frame is None:
            return None
        pose = odom.relative_to(self._frame)
        if self._follower is None:
            if (
                -view.approach_sign * pose.x >= self._params.clear_m
                or math.hypot(pose.x, pose.y) >= 2.0 * self._params.clear_m
            ):
                self._frame = None
                return None
            goal = Pose2(-view.approach_sign * self._params.clear_m, pose.y, pose.yaw)
            start = Point(pose, from_base(view.commanded, pose.yaw))
            self._follower = Follower(straight_to(start, goal, self._motion), self._motion)
        twist = self._follower.step(pose, view.dt_s)
        if self._follower.finished:
            self._frame = None
            return None
        return Step("backing off before turning", twist)

    def _turn(self, view: View, twist: Twist2) -> Step:
        self._turning_s += view.dt_s
        self._turned_rad += abs(twist.omega) * view.dt_s
        if self._turned_rad >= 2.0 * math.pi or self._turning_s > self._params.timeout_s:
            turned = f"after turning {math.degrees(self._turned_rad):.0f} deg in {self._turning_s:.0f} s"
            failure = Failure(DockCode.MARKERS_NOT_FOUND, f"no markers found {turned}")
            return Step(failure.reason, ZERO_TWIST, Trigger.TRY_FAILED, failure)
        return Step("turning to find markers", Twist2(0.0, 0.0, self._params.turning_radps))

"""From the first sighting to the dock pose: SERVOING, then FINE_ALIGN."""

from __future__ import annotations

import math

from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.docking.contact import ContactWatch
from robot_stack.docking.motion import Follower, Point, approach, correction, from_base
from robot_stack.docking.params import DockingParams
from robot_stack.docking.results import DockCode, Failure
from robot_stack.docking.situation import Step, View
from robot_stack.docking.states import Trigger


class Servoing:
    """To ``final_m`` before the dock pose: pose-based if the yaw is known, else by bearing and range."""

    def __init__(self, params: DockingParams) -> None:
        self._params = params
        self._elapsed_s = 0.0
        self.follower: Follower | None = None

    def tick(self, view: View) -> Step:
        self._elapsed_s += view.dt_s
        over = _interrupted(view, self._params)
        if over is not None:
            self.follower = None  # from rest a new reference
            return over
        assert view.base is not None
        assert view.estimate is not None
        if self._elapsed_s > self._params.servo.timeout_s:
            return _failed(DockCode.NOT_CONVERGED, f"not before the dock after {self._params.servo.timeout_s:.0f} s")
        if view.estimate.sigma_rad > self._params.servo.trusted_yaw_rad:
            self.follower = None
            return Step("approaching on bearing and range", self._by_bearing(view))
        if -view.approach_sign * view.base.x <= self._params.motion.final_m:
            return Step("before the dock", self._by_pose(view), Trigger.NEAR)
        return Step("approaching on pose", self._by_pose(view))

    def _by_pose(self, view: View) -> Twist2:
        assert view.base is not None
        if self.follower is None:
            start = Point(view.base, from_base(view.commanded, view.base.yaw))
            self.follower = Follower(approach(start, view.approach_sign, self._params.motion), self._params.motion)
        return self.follower.step(view.base, view.dt_s)

    def _by_bearing(self, view: View) -> Twist2:
        """Moves towards the board with the camera turned to it, up to ``bearing_distance_m`` from where it docks."""
        assert view.estimate is not None
        assert view.situation.odom is not None
        motion, board = self._params.motion, view.estimate.pose.relative_to(view.situation.odom)
        distance_m, nearest_m = math.hypot(board.x, board.y), view.docked_m + self._params.servo.bearing_distance_m
        bearing = math.atan2(view.approach_sign * board.y, view.approach_sign * board.x)
        turn = max(-motion.turning_radps, min(motion.turning_radps, motion.yaw_gain_per_s * bearing))
        speed = min(
            motion.along_mps,
            max(0.0, motion.position_gain_per_s * (distance_m - nearest_m)),
        )
        if distance_m == 0.0:
            return ZERO_TWIST
        return Twist2(speed * board.x / distance_m, speed * board.y / distance_m, turn)


class FineAlign:
    """The last centimetres: the rest of the reference, then feedback to rest, and alignment for long enough."""

    def __init__(self, follower: Follower | None, params: DockingParams) -> None:
        self._params = params
        self._follower = follower
        self._contact = ContactWatch(params.contact)
        self._elapsed_s = 0.0
        self._aligned_s = 0.0
        self._resting = False

    def tick(self, view: View) -> Step:
        self._elapsed_s += view.dt_s
        over = _interrupted(view, self._params)
        if over is not None:
            self._follower, self._aligned_s = None, 0.0
            return over
        assert view.base is not None
        problem = self._problem(view, view.base)
        if problem is not None:
            return _failed(problem.code, problem.reason)
        twist = self._command(view, view.base)
        if self._aligned(view.base):
            self._aligned_s += view.dt_s
            if self._aligned_s >= self._params.servo.aligned_for_s:
                return Step("aligned", ZERO_TWIST, Trigger.ALIGNED)
        else:
            self._aligned_s = 0.0
        return Step("aligning", twist)

    def _problem(self, view: View, base: Pose2) -> Failure | None:
        servo = self._params.servo
        moving_in = view.approach_sign * view.commanded.vx > 0.5 * self._params.motion.final_mps
        if self._contact.update(
            view.approach_sign * view.situation.force_n, -view.approach_sign * base.x, moving_in, view.dt_s
        ):
            return Failure(DockCode.CONTACT, f"touched something: {self._contact.excess_n:.0f} N")
        if abs(base.y) > servo.corridor_m or abs(base.yaw) > servo.corridor_rad:
            where = f"{1e3 * base.y:.0f} mm to the side, {math.degrees(base.yaw):.1f} deg"
            return Failure(DockCode.NOT_CONVERGED, f"left the corridor: {where}")
        if self._elapsed_s > servo.fine_timeout_s:
            error = f"{1e3 * math.hypot(base.x, base.y):.1f} mm, {math.degrees(base.yaw):.2f} deg"
            return Failure(DockCode.NOT_CONVERGED, f"not aligned after {servo.fine_timeout_s:.0f} s: {error} off")
        return None

    def _command(self, view: View, base: Pose2) -> Twist2:
        motion, servo = self._params.motion, self._params.servo
        if self._follower is None:
            start = Point(base, from_base(view.commanded, base.yaw))
            self._follower = Follower(approach(start, view.approach_sign, motion), motion)
        if not self._follower.finished:
            return self._follower.step(base, view.dt_s)
        size_m, turn_rad = math.hypot(base.x, base.y), abs(base.yaw)
        if self._resting:
            self._resting = size_m <= servo.resume_m and turn_rad <= servo.resume_rad
        else:
            self._resting = size_m <= servo.rest_m and turn_rad <= servo.rest_rad
        return ZERO_TWIST if self._resting else correction(base.inverse(), motion)

    def _aligned(self, base: Pose2) -> bool:
        servo = self._params.servo
        return math.hypot(base.x, base.y) < servo.aligned_m and abs(base.yaw) < servo.aligned_rad


def _interrupted(view: View, params: DockingParams) -> Step | None:
    """Why the robot cannot continue: no odometry, a moved dock, no markers in view."""
    if view.situation.odom is None:
        return Step("waiting for odometry", ZERO_TWIST)
    if view.moved:
        return _failed(DockCode.DOCK_MOVED, "the dock was moved")
    if view.base is None or view.seen_ago_s > params.servo.search_after_s:
        reason = f"markers lost for {params.servo.search_after_s:.0f} s"
        return Step(reason, ZERO_TWIST, Trigger.LOST, Failure(DockCode.MARKERS_LOST, reason))
    if view.seen_ago_s > params.servo.hold_after_s:
        return Step("markers out of sight", ZERO_TWIST)
    return None


def _failed(code: DockCode | object, reason: str) -> Step:
    assert isinstance(code, DockCode)
    return Step(reason, ZERO_TWIST, Trigger.TRY_FAILED, Failure(code, reason))

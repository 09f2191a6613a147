"""Drives along a route among obstacles: speed limits, the sampling controller, replanning, giving up.

stand-off    the robot makes room for a person who waits for it
route        requested from a planner that answers in a later tick; kept until its successor, requested when
             it is blocked, left behind, or without progress
reference    the next metres of it in the costmap's frame, with the speed that narrow places and people allow
command      the best motion along the reference, or the planned poses where they are narrow, under acceleration
             and jerk limits
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2, wrap_angle
from robot_stack.core.limits import MotionLimits
from robot_stack.core.people import Person
from robot_stack.core.robot import Footprint
from robot_stack.navigation.limits import PlanningLimits
from robot_stack.navigation.local_map import LocalMap, local_map
from robot_stack.navigation.params import NavigationParams, PeopleParams
from robot_stack.navigation.passing import PassingSide, beside
from robot_stack.navigation.path import Path
from robot_stack.navigation.pose_follower import PoseFollower
from robot_stack.navigation.pose_source import Located
from robot_stack.navigation.rollout_controller import RolloutController
from robot_stack.navigation.routes import RoutePlanner
from robot_stack.navigation.speed_limits import speed_limits
from robot_stack.navigation.tracker import bounded
from robot_stack.navigation.velocity_smoother import VelocitySmoother
from robot_stack.navigation.world_model import WorldModel
from robot_stack.navigation.yielding import nearest_m, way_out

Array = npt.NDArray[np.float64]
_SPACING_M = 0.1
# After "no way", a robot moved by more than this is replanned.
_MOVED_M = 0.5
# A slower robot that yields counts as waiting.
_STANDING_MPS = 0.2
# A robot faster than in narrow places by this brakes first, by the rollouts.
_FASTER_MPS = 0.1
_PLANNING, _ALONG, _ASIDE = "planning a route", "driving along the route", "giving way to a pedestrian"
_NOWHERE = local_map(0.0, 1.0, IDENTITY, np.zeros((1, 1), np.int8), np.zeros((1, 1), np.bool_))


@dataclass(frozen=True, slots=True)
class Step:
    """text: the activity. gave_up: there was no way for too long; the text has the reason.

    unreachable: the map leaves no way; reported at once; the text has the reason.
    """

    twist: Twist2
    text: str
    gave_up: bool = False
    unreachable: bool = False


class RouteFollower:
    """One goal at a time. ``route`` is replaced, never changed; None while there is no way."""

    def __init__(self, params: NavigationParams, surroundings: WorldModel, routes: RoutePlanner) -> None:
        self._params = params
        self._around = surroundings
        self._routes = routes
        self._sampling = RolloutController(params.local)
        self._smoother = VelocitySmoother()
        self._passing = PassingSide(params.passing, params.local.max_offset_m)
        self.route: Path | None = None
        self._last_route: Path | None = None
        self._poses: tuple[Path, PoseFollower] | None = None
        self._goal: Pose2 | None = None
        self._goal_before: Pose2 | None = None
        self._problem = ""
        self._asked = self._unreachable = False
        self._asked_with: tuple[bytes, Pose2] | None = None
        self._since_plan_s = math.inf
        self._without_way_s = 0.0
        self._stuck_s = 0.0
        self._giving_s = 0.0
        self._gave_way = 0
        # Waiting for a person to pass, and for how long since the last progress.
        self._waits, self._waited_s = False, 0.0
        self._at_side = False  # where people have a lane beside the robot
        self.recoveries = 0
        self._progress_at: Pose2 | None = None
        self._checked = -1
        self._blocked_at: tuple[float, float] | None = None
        self._blocked_looks = 0

    def begin(self, goal: Pose2, located: Located, footprint: Footprint, twist: Twist2) -> str:
        """Requests a route. twist: the last command, where the ramp starts. Returns the activity.

        Steps are allowed in any case: without a route the robot waits for one.
        """
        if goal not in (self._goal, self._goal_before):
            self._without_way_s, self._progress_at, self._gave_way, self._waited_s = 0.0, None, 0, 0.0
            self._last_route = None
        self._goal, self._goal_before = goal, None
        self._sampling.reset()
        self._passing.reset()
        self._smoother.reset(twist)
        self._stuck_s = self._giving_s = 0.0
        self.route, self._problem, self._blocked_at, self._blocked_looks = None, "", None, 0
        self._ask(located, footprint)
        return self._take()

    def forget(self, *, withdrawn: bool = False) -> None:
        """withdrawn: held, or withdrawn by the client, which may send it again after a warning: the time waited until
        then counts for the same goal."""
        self._routes.drop()
        self._goal_before = self._goal or self._goal_before if withdrawn else None
        if not withdrawn:
            self._without_way_s, self._progress_at = 0.0, None
        self.route, self._goal, self._stuck_s = None, None, 0.0
        self._blocked_at, self._problem, self._asked_with = None, "", None
        self._giving_s = 0.0
        self._asked = self._unreachable = False

    def step(self, located: Located, limits: PlanningLimits, footprint: Footprint, now_s: float, dt_s: float) -> Step:
        assert self._goal is not None
        f = self._params.follow
        self._since_plan_s += dt_s
        self._take()
        if self._unreachable:
            return self._refuse()
        self._look(located, footprint)
        again = self._blocked_at is not None or self._stuck_s >= f.stuck_s
        if again if self.route is not None else self._has_changed(located):
            self._ask_again(located, footprint)
        if self.route is None:
            return self._wait(located, limits, footprint, now_s, dt_s)
        self._note_progress(located.pose, dt_s)
        if self._without_way_s >= f.give_up_s:
            return self._give_up("no progress along the route", located)
        return self._drive(self.route, located, limits, footprint, now_s, dt_s)

    def _note_progress(self, pose: Pose2, dt_s: float) -> None:
        f = self._params.follow
        if self._progress_at is None or pose.distance_to(self._progress_at) > f.progress_m:
            self._progress_at, self._without_way_s, self._gave_way, self._waited_s = pose, 0.0, 0, 0.0
        elif self._stuck_s >= f.stuck_s and self._giving_s <= 0.0 and not self._waits:
            self._without_way_s += dt_s

    # --- driving -----------------------------------------------------------------------------------------------------

    def _drive(
        self, route: Path, located: Located, planning: PlanningLimits, footprint: Footprint, now_s: float, dt_s: float
    ) -> Step:
        around, p, limits = self._around, self._params, planning.cruise
        along_m, beside_m = route.project(located.pose.x, located.pose.y)
        if abs(beside_m) > p.follow.off_route_m:
            self._ask_again(located, footprint)
        ahead = self.ahead(route, along_m)
        metres = np.arange(len(ahead)) * _SPACING_M
        local = self._local()
        speed = self._smoother.twist.speed()
        people = around.people if around.seeing else ()
        if around.seeing:
            ahead = self._pass(ahead, around.everybody, footprint, now_s, speed)
        clear = around.clearance_m(footprint, ahead)
        at = around.to_odom(ahead)
        along = np.column_stack((at, metres))
        waits = p.passage if self._waited_s < p.passage.wait_s else None
        zones = around.zone_speed_mps(ahead)
        zones = np.where(metres >= around.doors.stop_m(footprint, ahead, _SPACING_M), 0.0, zones)
        lets_pass = self._waited_s < p.people.yield_most_s
        cap = speed_limits(
            along, clear, zones, people, now_s, speed, limits, footprint, p.speed_limits, p.people, waits, lets_pass
        )
        self._waits = cap.yields and speed < _STANDING_MPS
        self._waited_s += dt_s if self._waits else 0.0
        start = self._smoother.start(located.twist)
        table = _table(people, now_s, p.people)
        aside = self._sidestep(route, located, footprint, table) or self._give_way(located, footprint, now_s, dt_s)
        if aside is not None:
            aside = self._in_zones(aside, located, footprint, limits)
            change = planning.braking if aside.speed() < speed else limits
            return Step(self._smoother.towards(aside, start, change, dt_s), _ASIDE)
        pose = located.pose.relative_to(around.map_to_odom)
        exact = self._exact(route, located, footprint, float(cap.speed_mps[:3].min()), limits)
        if exact is not None:
            wanted, clear_way = self._sampling.governed(pose, exact, footprint, local, table, p.passage.margin_m)
            requested = wanted if clear_way else ZERO_TWIST
            urgent = requested.speed() < speed
        else:
            choice = self._sampling.step(
                pose, start, np.column_stack((at, metres, cap.speed_mps)), limits, footprint, local, table
            )
            requested, urgent = choice.twist, choice.urgent
        requested = self._in_zones(requested, located, footprint, limits)
        twist = self._smoother.towards(requested, start, planning.braking if urgent else limits, dt_s)
        slow = twist.speed() < p.follow.stuck_mps and abs(twist.omega) < 2.0 * p.follow.stuck_mps
        self._stuck_s = self._stuck_s + dt_s if slow and not around.doors.text else 0.0
        if cap.yields and speed < _STANDING_MPS:
            return Step(twist, "waiting for a pedestrian to pass")
        return Step(twist, "blocked, searching for a path" if slow else _ALONG)

    def _exact(
        self, route: Path, located: Located, footprint: Footprint, speed_mps: float, limits: MotionLimits
    ) -> Twist2 | None:
        """The motion along the planned poses where they are narrow; None elsewhere, and off the route."""
        p = self._params.passage
        if self._poses is None or self._poses[0] is not route:
            self._poses = route, PoseFollower(route, p, self._params.tracking)
        follower = self._poses[1]
        near = follower.locate(located.pose)
        if not near:
            along_m, _ = route.project(located.pose.x, located.pose.y)
            ahead = self.ahead(route, along_m)[: round(p.ahead_m / _SPACING_M)]
        else:
            ahead = follower.ahead(p.ahead_m)
        clear_m = self._around.clearance_m(footprint, ahead)
        if float(clear_m.min()) >= p.narrow_m or self._smoother.twist.speed() > p.speed_mps + _FASTER_MPS:
            return None
        if not near:
            self._ask_again(located, footprint)
            return None
        return follower.command(located.pose, ahead, clear_m, speed_mps, limits)

    def _pass(
        self,
        ahead: Array,
        people: tuple[Person, ...],
        footprint: Footprint,
        now_s: float,
        speed_mps: float,
    ) -> Array:
        """``ahead``, (n, 3) in map, beside the route where people come."""
        around = self._around

        def clearance_m(offset_m: float, count: int) -> float:
            return float(around.clearance_m(footprint, beside(ahead, offset_m)[:count]).min())

        route = np.column_stack((around.to_odom(ahead), _SPACING_M * np.arange(len(ahead))))
        offsets_m = self._passing.offsets_m(route, people, now_s, speed_mps, footprint, clearance_m)
        return beside(ahead, offsets_m)

    def _sidestep(self, route: Path, located: Located, footprint: Footprint, people: Array) -> Twist2 | None:
        """Sideways motion to the side on which people pass, once they are near; None there, or if it is not clear.

        people: (m, 6), odom.
        """
        p, pose = self._params.passing, located.pose
        along_m, beside_m = route.project(pose.x, pose.y)
        left_m = self._passing.offset_m - beside_m
        farther = left_m * self._passing.offset_m > 0.0
        near = self._passing.nearest_m <= p.near_m
        self._at_side = near and self._passing.offset_m != 0.0 and (abs(left_m) < p.done_m or not farther)
        if not near or abs(left_m) < p.done_m or not farther:
            return None
        (x0, y0, _), (x1, y1, heading_rad) = self.ahead(route, along_m)[:2]
        course_rad = math.atan2(y1 - y0, x1 - x0) - pose.yaw
        speed_mps = math.copysign(min(p.speed_mps, p.gain_per_s * abs(left_m)), left_m)
        turn = self._params.give_way.turn_radps
        omega = max(-turn, min(turn, wrap_angle(heading_rad - pose.yaw)))
        twist = Twist2(-speed_mps * math.sin(course_rad), speed_mps * math.cos(course_rad), omega)
        margin_m = self._params.local.governor_margin_m
        odom = pose.relative_to(self._around.map_to_odom)
        twist, clear = self._sampling.governed(odom, twist, footprint, self._local(), people, margin_m)
        return twist if clear and twist.speed() > p.gain_per_s * p.done_m * 0.5 else None

    def _in_zones(self, twist: Twist2, located: Located, footprint: Footprint, limits: MotionLimits) -> Twist2:
        """``twist`` at the zones' speed, stopping before closed doors, without its motion against a one-way zone beyond
        ``back_m``.
        """
        deceleration_mps2 = self._params.speed_limits.braking_share * limits.acceleration_mps2
        back_m = self._around.back_left_m(located.pose, twist)
        if back_m == 0.0:
            return Twist2(0.0, 0.0, twist.omega)
        # The wanted motion may turn from the present one into a zone.
        ways = (self._smoother.twist, twist)
        zone_mps = min(self._around.zone_limit_mps(located, way, deceleration_mps2) for way in ways)
        door_mps = self._around.doors.limit_mps(footprint, located.pose, twist, deceleration_mps2)
        speed_mps = min(zone_mps, door_mps, math.sqrt(2.0 * deceleration_mps2 * back_m))
        return bounded(twist, speed_mps, math.inf)

    def _local(self) -> LocalMap:
        return self._around.local or _NOWHERE

    def _give_way(
        self,
        located: Located,
        footprint: Footprint,
        now_s: float,
        dt_s: float,
        crowd: tuple[Person, ...] | None = None,
    ) -> Twist2 | None:
        """The motion to make room for a person, zero to let them pass; None if not needed or without effect.

        crowd: what stands in the way if there is no route: it needs more room to come out. A group that leaves a way is
        an obstacle instead.
        """
        p, giving = self._params.give_way, self._giving_s > 0.0
        if not giving and (self._stuck_s < self._params.follow.stuck_s or self._gave_way >= p.tries):
            return None
        pose = located.pose.relative_to(self._around.map_to_odom)
        if self._at_side and self._waited_s < self._params.passage.wait_s:
            # They have a lane: farther away, the robot would only draw them along.
            walk = _rows(tuple(one for one in self._around.people if one.walks), now_s, self._params.people)
            self._waited_s += 0.0 if nearest_m(pose, footprint, walk) < p.watch_m else dt_s
            self._waits = True
            return ZERO_TWIST
        # A person just out of an occlusion may stand without having been seen walking.
        seen = self._around.people if crowd is None else crowd
        everybody = seen if self._around.seeing else ()
        people = _rows(everybody, now_s, self._params.people)
        gap_m, twist = nearest_m(pose, footprint, people), None
        roomy = crowd is not None and any(one.walked for one in everybody)
        near_m, room_m = (p.watch_m, p.watch_m) if roomy else (p.near_m, p.room_m)
        if self._giving_s < p.most_s and gap_m < (room_m if giving else near_m):
            margin_m = self._params.local.governor_margin_m
            turn_rad = wrap_angle(self._heading_rad(located.pose) - located.pose.yaw)
            twist = way_out(pose, footprint, self._local(), people, margin_m, p, room_m, turn_rad)
        walkers = _rows(tuple(one for one in everybody if one.walks), now_s, self._params.people)
        if twist is None and giving and self._giving_s < p.most_s and nearest_m(pose, footprint, walkers) < p.watch_m:
            twist = ZERO_TWIST
        if twist is not None:
            self.recoveries += not giving
            self._giving_s += dt_s
            return twist
        if giving:
            self._giving_s, self._stuck_s, self._gave_way = 0.0, 0.0, self._gave_way + 1
            self._ask_again(located, footprint)
        return None

    def _heading_rad(self, pose: Pose2) -> float:
        """Of the way at the robot, which is the newest route; the robot's own without any."""
        if self._last_route is None:
            return pose.yaw
        along_m, _ = self._last_route.project(pose.x, pose.y)
        return float(self.ahead(self._last_route, along_m)[0, 2])

    def ahead(self, route: Path, along_m: float) -> Array:
        """(n, 3) poses of the route from ``along_m`` on, evenly spaced, as far as the local controller looks."""
        end_m = min(route.length_m, along_m + self._params.follow.ahead_m)
        count = max(2, math.ceil((end_m - along_m) / _SPACING_M) + 1)
        at = np.minimum(along_m + _SPACING_M * np.arange(count), route.length_m)
        yaw = np.unwrap(route.poses[:, 2])
        columns = (route.poses[:, 0], route.poses[:, 1], yaw)
        return np.column_stack([np.interp(at, route.arc_length_m, column) for column in columns])

    # --- routes ------------------------------------------------------------------------------------------------------

    def _ask(self, located: Located, footprint: Footprint) -> None:
        assert self._goal is not None
        self._since_plan_s = 0.0
        self._asked, self._asked_with = True, (self._around.shown(), located.pose)
        self._routes.ask(self._around.question(located.pose, self._goal, footprint))

    def _ask_again(self, located: Located, footprint: Footprint) -> None:
        """Requests again, at least an interval after the last request, and not while one is pending."""
        if not self._asked and self._since_plan_s >= self._params.follow.replan_interval_s:
            self._ask(located, footprint)
            self._take()

    def _has_changed(self, located: Located) -> bool:
        """True if the answer may differ from "no way": the seen obstacles changed, or the robot was moved."""
        if self._asked or self._since_plan_s < self._params.follow.replan_interval_s or self._asked_with is None:
            return False
        shown, pose = self._asked_with
        if pose.distance_to(located.pose) > _MOVED_M or shown != self._around.shown():
            return True
        self._since_plan_s = 0.0  # next check after the interval, which saves a digest per tick
        return False

    def _take(self) -> str:
        """Takes the answer if available. Returns the activity."""
        answer = self._routes.take() if self._asked else None
        if answer is None:
            return _PLANNING
        self._asked = False
        self.route, self._problem, self._unreachable = answer.route, answer.reason, answer.lasting
        if self.route is not None:
            # A route around people who stand leads to where they will go on.
            if self._last_route is None or (self._blocked_at is None and self._stuck_s == 0.0):
                self._last_route = self.route
            self._blocked_at, self._blocked_looks = None, 0
        return self._problem or _ALONG

    def _look(self, located: Located, footprint: Footprint) -> None:
        """Checks the route against a new costmap."""
        if self.route is None or self._checked == self._around.costmaps:
            return
        self._checked = self._around.costmaps
        along_m, _ = self.route.project(located.pose.x, located.pose.y)
        ahead = self.ahead(self.route, along_m)
        clear = self._around.clearance_m(footprint, ahead)
        # The robot may leave a place nearer to an obstacle than the margin.
        # A closed door stops the robot by itself, and what is behind it may change until it is open.
        clear = clear[: self._around.doors.closed_from(footprint, ahead)]
        blocked = np.flatnonzero(clear[5:] < min((self._params.follow.blocked_margin_m, *clear[:1])))
        self._blocked_looks = self._blocked_looks + 1 if len(blocked) else 0
        if self._blocked_looks >= 2:
            x, y, _ = ahead[blocked[0] + 5]
            self._blocked_at = (float(x), float(y))
        else:
            self._blocked_at = None

    def _wait(self, located: Located, limits: PlanningLimits, footprint: Footprint, now_s: float, dt_s: float) -> Step:
        if self._asked and not self._problem:
            # The way ahead may not be clear any more: brake as hard as allowed.
            return Step(self._smoother.towards(ZERO_TWIST, self._smoother.twist, limits.braking, dt_s), _PLANNING)
        self._stuck_s += dt_s
        aside, crowd = None, self._around.in_the_way(now_s)
        if self._last_route is not None and self._around.seeing:
            route = self._last_route
            along_m, _ = route.project(located.pose.x, located.pose.y)
            ahead = self.ahead(route, along_m)
            self._pass(ahead, crowd, footprint, now_s, 0.0)
            people = _table(self._around.people, now_s, self._params.people)
            aside = self._sidestep(route, located, footprint, people)
        aside = aside or self._give_way(located, footprint, now_s, dt_s, crowd)
        if aside is not None:
            aside = self._in_zones(aside, located, footprint, limits.cruise)
            return Step(self._smoother.towards(aside, self._smoother.twist, limits.cruise, dt_s), _ASIDE)
        self._without_way_s += dt_s
        text = f"the only path is blocked{self._where()}"
        if self._without_way_s >= self._params.follow.give_up_s:
            return self._give_up(text, located)
        return Step(self._smoother.towards(ZERO_TWIST, self._smoother.twist, limits.cruise, dt_s), f"waiting: {text}")

    def _refuse(self) -> Step:
        text = self._problem
        self.forget()
        return Step(ZERO_TWIST, text, unreachable=True)

    def _where(self) -> str:
        if self._blocked_at is None:
            return f": {self._problem}" if self._problem else ""
        return f" at ({self._blocked_at[0]:.1f}, {self._blocked_at[1]:.1f})"

    def _give_up(self, why: str, located: Located) -> Step:
        self.forget()
        pose = located.pose
        return Step(ZERO_TWIST, f"gave up at ({pose.x:.1f}, {pose.y:.1f}): {why}", gave_up=True)


def _table(people: tuple[Person, ...], now_s: float, params: PeopleParams) -> Array:
    """(m, 6) rows of all people who have walked, as input of the rollouts."""
    return _rows(tuple(one for one in people if one.walked), now_s, params)


def _rows(people: tuple[Person, ...], now_s: float, params: PeopleParams) -> Array:
    rows = [
        (*one.at(now_s), *one.velocity, one.radius_m, params.walking_gap_m if one.walks else params.standing_gap_m)
        for one in people
    ]
    return np.array(rows).reshape(-1, 6)

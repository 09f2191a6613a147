"""Drives along a route among obstacles: speed caps, the sampling controller, planning afresh, giving up.

route        from the global planner, kept until it is blocked, left behind, or gets the robot nowhere
reference    the next metres of it in the costmap's frame, with the speed that narrow places and people allow
command      the best motion along the reference, under acceleration and jerk limits
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.core.robot import Footprint
from robot_stack.navigation.caps import caps
from robot_stack.navigation.global_planner import NoWay
from robot_stack.navigation.limits import MotionLimits, PlanningLimits
from robot_stack.navigation.local_map import LocalMap
from robot_stack.navigation.params import NavigationParams, PeopleParams
from robot_stack.navigation.path import Path
from robot_stack.navigation.people import Person
from robot_stack.navigation.pose_source import Located
from robot_stack.navigation.ramp import Ramp
from robot_stack.navigation.sampling import SamplingController
from robot_stack.navigation.surroundings import Surroundings

Array = npt.NDArray[np.float64]
_SPACING_M = 0.1
_NOWHERE = LocalMap(0.0, 1.0, 0.0, 0.0, np.zeros((1, 1), np.int8), np.full((1, 1), 10.0, np.float32))


@dataclass(frozen=True, slots=True)
class Step:
    """text: what goes on. gave_up: there was no way for too long; the text says why."""

    twist: Twist2
    text: str
    gave_up: bool = False


class RouteFollower:
    """One goal at a time. ``route`` is replaced, never changed; None while there is no way."""

    def __init__(self, params: NavigationParams, surroundings: Surroundings) -> None:
        self._params = params
        self._around = surroundings
        self._sampling = SamplingController(params.local)
        self._ramp = Ramp()
        self.route: Path | None = None
        self._goal: Pose2 | None = None
        self._problem = ""
        self._since_plan_s = math.inf
        self._without_way_s = 0.0
        self._stuck_s = 0.0
        self._checked = -1
        self._blocked_at: tuple[float, float] | None = None
        self._blocked_looks = 0

    def begin(self, goal: Pose2, located: Located, footprint: Footprint, twist: Twist2) -> str:
        """Plans a route. twist: the last command, from which this goes on. Returns why there is none, else nothing.

        A step may follow either way: without a route the robot waits for one.
        """
        if goal != self._goal:
            self._without_way_s = 0.0
        self._goal = goal
        self._sampling.reset()
        self._ramp.reset(twist)
        self._stuck_s = 0.0
        return self._plan(located, footprint)

    def forget(self) -> None:
        self.route, self._goal, self._without_way_s, self._stuck_s = None, None, 0.0, 0.0
        self._blocked_at, self._problem = None, ""

    def step(self, located: Located, limits: PlanningLimits, footprint: Footprint, now_s: float, dt_s: float) -> Step:
        assert self._goal is not None
        f = self._params.follow
        self._since_plan_s += dt_s
        self._look(located, footprint)
        again = self.route is None or self._blocked_at is not None or self._stuck_s >= f.stuck_s
        if again and self._since_plan_s >= f.replan_interval_s:
            self._plan(located, footprint)
        if self.route is None:
            return self._wait(limits.cruise, located, dt_s)
        self._without_way_s = 0.0 if self._stuck_s < f.stuck_s else self._without_way_s + dt_s
        if self._without_way_s >= f.give_up_s:
            return self._give_up("no progress along the route", located)
        return self._drive(self.route, located, limits, footprint, now_s, dt_s)

    # --- driving -----------------------------------------------------------------------------------------------------

    def _drive(
        self, route: Path, located: Located, planning: PlanningLimits, footprint: Footprint, now_s: float, dt_s: float
    ) -> Step:
        around, p, limits = self._around, self._params, planning.cruise
        along_m, beside_m = route.project(located.pose.x, located.pose.y)
        if abs(beside_m) > p.follow.off_route_m and self._since_plan_s >= p.follow.replan_interval_s:
            self._plan(located, footprint)
            if self.route is None:
                return self._wait(planning.cruise, located, dt_s)
            along_m, _ = self.route.project(located.pose.x, located.pose.y)
            route = self.route
        ahead = self._ahead(route, along_m)
        clear = around.clearance_m(footprint, ahead)
        at = around.to_odom(ahead)
        metres = np.arange(len(ahead)) * _SPACING_M
        local = around.local if around.seeing and around.local is not None else _NOWHERE
        speed = self._ramp.twist.speed()
        people = around.people if around.seeing else ()
        cap = caps(np.column_stack((at, metres)), clear, people, now_s, speed, limits, footprint, p.caps, p.people)
        start = self._ramp.start(located.twist)
        choice = self._sampling.step(
            located.pose.relative_to(around.map_to_odom),
            start,
            np.column_stack((at, metres, cap.speed_mps)),
            limits,
            footprint,
            local,
            _table(people, now_s, p.people),
        )
        twist = self._ramp.towards(choice.twist, start, planning.braking if choice.urgent else limits, dt_s)
        slow = twist.speed() < p.follow.stuck_mps and abs(twist.omega) < 2.0 * p.follow.stuck_mps
        self._stuck_s = self._stuck_s + dt_s if slow else 0.0
        if cap.yields and speed < 0.2:
            return Step(twist, "waiting for somebody to pass")
        return Step(twist, "looking for a way past" if slow else "driving along the route")

    def _ahead(self, route: Path, along_m: float) -> Array:
        """(n, 3) poses of the route from ``along_m`` on, evenly spaced, as far as the local controller looks."""
        end_m = min(route.length_m, along_m + self._params.follow.ahead_m)
        count = max(2, math.ceil((end_m - along_m) / _SPACING_M) + 1)
        at = np.minimum(along_m + _SPACING_M * np.arange(count), route.length_m)
        yaw = np.unwrap(route.poses[:, 2])
        columns = (route.poses[:, 0], route.poses[:, 1], yaw)
        return np.column_stack([np.interp(at, route.arc_length_m, column) for column in columns])

    # --- routes ------------------------------------------------------------------------------------------------------

    def _plan(self, located: Located, footprint: Footprint) -> str:
        assert self._goal is not None
        self._since_plan_s = 0.0
        found = self._around.plan(located.pose, self._goal, footprint)
        if isinstance(found, NoWay):
            self.route, self._problem = None, found.reason
            return found.reason
        self.route, self._problem, self._blocked_at, self._blocked_looks = found, "", None, 0
        return ""

    def _look(self, located: Located, footprint: Footprint) -> None:
        """Whether a new costmap shows something on the route."""
        if self.route is None or self._checked == self._around.costmaps:
            return
        self._checked = self._around.costmaps
        along_m, _ = self.route.project(located.pose.x, located.pose.y)
        ahead = self._ahead(self.route, along_m)
        clear = self._around.clearance_m(footprint, ahead)
        # Where the robot stands it may leave.
        blocked = np.flatnonzero(clear[5:] < min(self._params.follow.blocked_margin_m, float(clear[0])))
        self._blocked_looks = self._blocked_looks + 1 if len(blocked) else 0
        if self._blocked_looks >= 2:
            x, y, _ = ahead[blocked[0] + 5]
            self._blocked_at = (float(x), float(y))
        else:
            self._blocked_at = None

    def _wait(self, limits: MotionLimits, located: Located, dt_s: float) -> Step:
        self._without_way_s += dt_s
        text = f"the only way is blocked{self._where()}"
        if self._without_way_s >= self._params.follow.give_up_s:
            return self._give_up(text, located)
        twist = self._ramp.towards(ZERO_TWIST, self._ramp.twist, limits, dt_s)
        return Step(twist, f"waiting: {text}")

    def _where(self) -> str:
        if self._blocked_at is None:
            return f": {self._problem}" if self._problem else ""
        return f" at ({self._blocked_at[0]:.1f}, {self._blocked_at[1]:.1f})"

    def _give_up(self, why: str, located: Located) -> Step:
        self.forget()
        pose = located.pose
        return Step(ZERO_TWIST, f"gave up at ({pose.x:.1f}, {pose.y:.1f}): {why}", gave_up=True)


def _table(people: tuple[Person, ...], now_s: float, params: PeopleParams) -> Array:
    """(m, 6) of everybody who has walked, as the rollouts want them."""
    rows = [
        (*one.at(now_s), *one.velocity, one.radius_m, params.walking_gap_m if one.walks else params.standing_gap_m)
        for one in people
        if one.walked
    ]
    return np.array(rows).reshape(-1, 6)

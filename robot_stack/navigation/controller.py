"""The navigation kernel: goals in, velocity commands and plans out, tick by tick.

States and transitions: navigation.states.

A robot that has stood for long warns people before it moves: HELD, or FOLLOWING with a zero command.
If motion is forbidden, the command is zero at once: the drive ramps down by its own limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from robot_stack.core.departure import SETTING_OUT, Departure
from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.core.goals import GoalStatus
from robot_stack.core.levels import Levels
from robot_stack.core.limits import NO_LIMIT, MotionLimits, SpeedLimit
from robot_stack.core.robot import Footprint, Robot
from robot_stack.core.route_graph import RouteGraph
from robot_stack.core.site_map import Grid
from robot_stack.core.zones import Zone
from robot_stack.navigation.doors import DoorRequest
from robot_stack.navigation.follower import RouteFollower
from robot_stack.navigation.goal import GoalCode, GoalEnd, GoalRequest, Refusal, refusal, too_far
from robot_stack.navigation.lanes import Lanes
from robot_stack.navigation.lifts import Lifts, Ride, Stage
from robot_stack.navigation.limits import PlanningLimits, planning_limits
from robot_stack.navigation.line_of_sight import allowed_speed, is_direct
from robot_stack.navigation.motion import MotionState, Trajectory, moving
from robot_stack.navigation.params import NavigationParams
from robot_stack.navigation.path import Path, path_of
from robot_stack.navigation.plan import plan_motion, plan_stop
from robot_stack.navigation.pose_source import Located
from robot_stack.navigation.progress_checker import ProgressChecker
from robot_stack.navigation.routes import PromptRoutes, RoutePlanner, RouteSolver
from robot_stack.navigation.states import NavigationState, Trigger, target_of
from robot_stack.navigation.tracker import (
    TrackingError,
    begun,
    bounded,
    command,
    settle_command,
    tracking_error,
    waiting_rate,
)
from robot_stack.navigation.world_model import WorldModel

# A goal within these distances of the present one is a repetition of it.
_SAME_M, _SAME_RAD = 1e-3, 1e-3
_SAME_WAY_M = 5e-3
# An unreachable goal is not planned again from a start within this distance.
_SAME_START_M = 1.0
_NO_ERROR = TrackingError(0.0, 0.0, 0.0)
_EMERGENCY = Refusal(GoalCode.STOPPED, "an emergency stop is active: send the goal again after its release")


@dataclass(frozen=True, slots=True)
class Situation:
    """Inputs of a tick. located: None while pose or odometry are missing; ``located_problem`` is the reason.

    blind: why obstacle data is missing, else an empty text. manual: a person controls the drive by hand.
    """

    now_s: float
    located: Located | None
    located_problem: str = ""
    emergency_stop: bool = False
    blind: str = ""
    manual: bool = False


@dataclass(frozen=True, slots=True)
class Output:
    """twist: the command, base_link. planned: the pose the robot should have now, None without a plan.

    text: the activity, for people. end: how the goal ended, in the first tick after that. doors: requests to publish.
    relocated: in a lift that has arrived: the pose in the map from which localization goes on.
    """

    twist: Twist2
    state: NavigationState
    text: str
    planned: Pose2 | None = None
    error: TrackingError = _NO_ERROR
    end: GoalEnd | None = None
    doors: tuple[DoorRequest, ...] = ()
    relocated: Pose2 | None = None

    @property
    def reached(self) -> bool:
        return self.end is not None and self.end.succeeded

    def figures(self) -> dict[str, str]:
        """For diagnostics."""
        error = self.error
        return {
            "state": self.state.value,
            "tracking error": f"{1e3 * error.distance_m():.0f} mm, {error.yaw:.3f} rad",
        }


@dataclass(frozen=True, slots=True)
class _Unreachable:
    """A goal known to be unreachable: it need not be planned again on the same map."""

    goal: Pose2
    footprint: Footprint
    start: Pose2
    problem: Refusal


class NavigationController:
    """One goal at a time. ``path`` is published as ``/plan``; a new plan replaces the object, which never changes.

    departure: decides whether people must be warned first. routes: factory of the route planner; the default plans in
    the tick of the request. zones, graph, levels: of a site with a map.
    """

    def __init__(
        self,
        params: NavigationParams,
        robot: Robot,
        map_frame: str,
        departure: Departure,
        grid: Grid | None = None,
        routes: Callable[[RouteSolver], RoutePlanner] = PromptRoutes,
        zones: tuple[Zone, ...] = (),
        graph: RouteGraph | None = None,
        levels: Levels | None = None,
    ) -> None:
        self._params = params
        self._departure = departure
        self._robot = robot
        self._map_frame = map_frame
        self._passenger = False
        self._speed_limit = self._way_limit = NO_LIMIT
        self._state = NavigationState.IDLE
        self._goal: Pose2 | None = None
        levels = levels or Levels()
        self._lifts = Lifts(levels)
        self._stage: Stage | None = None  # of the goal, since its first plan
        self._relocated_s = math.inf  # since the last change of the level
        self._trajectory: Trajectory | None = None
        self._elapsed_s = 0.0
        self._since_plan_s = math.inf
        self._starting = False
        self._settling_s = 0.0
        self._last_tick_s = math.nan
        self._twist = ZERO_TWIST
        self._text = "no goal"
        self.path: Path | None = None
        # The caller supplies the costmaps.
        lanes = None if graph is None else Lanes(graph, params.graph, params.limits.cruise_speed_mps)
        self.around = WorldModel(params, grid, zones, lanes, levels.doors)
        solver = RouteSolver(params.planner, self.around.grid, lanes)
        self._follower = RouteFollower(params, self.around, routes(solver))
        self._progress_checker = ProgressChecker(params.follow.give_up_s)
        self._checked_goal: Pose2 | None = None
        self._unreachable: _Unreachable | None = None
        self._narrow_mps = math.inf
        self._now_s = 0.0
        self._looked = -1
        self._since_try_s = 0.0
        self._located: Located | None = None
        self._end: GoalEnd | None = None

    @property
    def state(self) -> NavigationState:
        return self._state

    @property
    def goal(self) -> Pose2 | None:
        return self._goal

    @property
    def remaining_m(self) -> float:
        """Length of the way from the robot to the goal, m; 0 without a plan or a pose.

        That of the plan, and across levels what is behind it, rides included, by straight lines in the map's plane.
        """
        if self.path is None or self._located is None:
            return 0.0
        pose = self._located.pose
        beyond_m = 0.0 if self._stage is None else self._stage.beyond_m
        return self.path.length_m - self.path.project(pose.x, pose.y)[0] + beyond_m

    @property
    def recoveries(self) -> int:
        """How often the robot has made room for a person on the way to its goal."""
        return self._follower.recoveries

    def take_end(self) -> GoalEnd | None:
        """How the newest goal ended, once, unless an output had it. A goal that another one replaces has no end."""
        end, self._end = self._end, None
        if end is not None and end.outcome is not GoalStatus.CANCELED:
            self._checked_goal = None
        return end

    # --- events ------------------------------------------------------------------------------------------------------

    def set_passenger(self, attached: bool) -> None:
        """Sets the limits by the passenger; a running plan continues under the new ones."""
        if attached != self._passenger:
            self._passenger = attached
            self._replan_with_limits()
            if self._state is NavigationState.FOLLOWING and self._located is not None:
                self._follow(self._located)  # with another footprint

    def set_speed_limit(self, limit: SpeedLimit) -> None:
        """Sets the newest limit of the safety monitor; a running plan continues under it."""
        if limit != self._speed_limit:
            self._speed_limit = limit
            self._replan_with_limits()

    def set_way_limit(self, limit: SpeedLimit) -> None:
        """Sets the newest limit of the client that sends the goals; a running plan slows down to it."""
        if limit != self._way_limit:
            self._way_limit = limit
            self._replan_with_limits()

    def request(
        self, request: GoalRequest, now_s: float, located: Located | None, *, emergency_stop: bool = False
    ) -> str:
        """A new goal, which replaces the present one. Returns why it was refused, else an empty text.

        emergency_stop: one is in force. A goal accepted now would start motion at the release.

        A refused goal also ends the previous one, since the intended goal is unknown: the robot stops.
        """
        self._end = None
        pose = None if located is None else located.pose
        self._know(now_s, located)
        problem = _EMERGENCY if emergency_stop else refusal(request, self._map_frame, now_s, pose, self._params.goal)
        problem = problem or self.around.goal_problem(self._footprint(), request.pose)
        problem = problem or self._known_unreachable(request.pose, located)
        if not problem and pose is not None:
            way = self._way(pose, request.pose)
            problem = way if isinstance(way, Refusal) else None
        if problem:
            self._abort(problem)
            return problem.text
        self._take(request.pose, located)
        return ""

    def cancel(self) -> None:
        """Withdraws the goal: a moving robot comes to rest within the limits of an ordinary ride."""
        self._withdraw(GoalEnd(GoalStatus.CANCELED, "goal cancelled"))

    def stop(self) -> None:
        """Ends the motion and drops the goal: the release of an emergency stop starts no motion (ISO 13850)."""
        if self._state is not NavigationState.IDLE:
            self._follower.forget()
            text = "emergency stop: the goal is dropped"
            if self._goal is not None:
                self._end = GoalEnd(GoalStatus.ABORTED, text, GoalCode.STOPPED)
            self._finish(Trigger.EMERGENCY_STOP, text)

    def tick(self, situation: Situation) -> Output:
        """One step of the control loop. Never returns a twist that is not finite."""
        dt_s = self._step_s(situation.now_s)
        self._since_plan_s += dt_s
        self._relocated_s += dt_s
        self._know(situation.now_s, situation.located)
        located = situation.located
        if located is not None:
            # What people drive by hand uses up nothing.
            driven = ZERO_TWIST if self._state is NavigationState.IDLE else located.twist
            self.around.count_back(located.pose, driven, dt_s)
        doors = self._update_doors(located)
        self._departure.elapse(None if located is None else located.twist, dt_s)
        if situation.emergency_stop:
            self.stop()
        if not situation.manual:
            self._check_progress(dt_s)
        obstacle = self._obstacle(situation)
        if obstacle and self._state is not NavigationState.IDLE:
            self._hold(obstacle)
        ride = None if situation.emergency_stop else self._in_lift(located)
        if ride is not None and located is not None:
            self._departure.drop()
            output = self._ride(ride, located)
        elif located is None or obstacle or self._state is NavigationState.IDLE:
            self._departure.drop()
            output = self._idle()
        else:
            output = self._set_out(located, dt_s)
        self._twist = output.twist if output.twist.is_finite() else ZERO_TWIST
        return replace(output, twist=self._twist, end=self.take_end(), doors=doors)

    def _update_doors(self, located: Located | None) -> tuple[DoorRequest, ...]:
        if not self.around.doors.exist:
            return ()
        if located is not None and not located.pose.is_finite():
            located = None
        planned = self._state is not NavigationState.FOLLOWING or self._follower.route is not None
        ahead = None
        ride = None if self._stage is None else self._stage.ride
        if self._goal is None or ride is not None:
            ahead = np.empty((0, 3))
        elif located is not None and self.path is not None and self._state is not NavigationState.HELD and planned:
            ahead = self._follower.ahead(self.path, self.path.project(located.pose.x, located.pose.y)[0])
        here, stands = (None, False) if located is None else (located.pose, self._standing(located.twist))
        kept = "" if self._stage is None or ride is not None else self._stage.door
        called = "" if ride is None else ride.end.door
        return self.around.doors.update(
            ahead, here, self._footprint(), self._now_s, stands=stands, kept=kept, called=called
        )

    def _check_progress(self, dt_s: float) -> None:
        """Ends the goal if the robot does not follow its commands."""
        if self._goal is None or self._located is None:
            return
        pose = self._located.pose
        if self._progress_checker.is_stalled(pose, self._twist, dt_s):
            text = f"gave up at ({pose.x:.1f}, {pose.y:.1f}): the robot does not move as commanded"
            self._withdraw(GoalEnd(GoalStatus.ABORTED, text, GoalCode.FAILED_TO_MAKE_PROGRESS))

    # --- one tick, by state ------------------------------------------------------------------------------------------

    def _set_out(self, located: Located, dt_s: float) -> Output:
        """Runs a step; if it would start motion after a long stop, people are warned first."""
        if not self._departure.warning:
            output = self._step(located, dt_s)
            if output.twist == ZERO_TWIST or not self._departure.due:
                return output
            if self._state is not NavigationState.FOLLOWING:
                self._hold(SETTING_OUT)  # replanned from rest after the warning
        if not self._departure.cleared(dt_s):
            self._text = SETTING_OUT
            return self._idle()
        if self._state is NavigationState.FOLLOWING:
            self._follow(located)
        return self._step(located, dt_s)

    def _step(self, located: Located, dt_s: float) -> Output:
        if self._state is NavigationState.HELD:
            self._text = "waiting for standstill"
            if self._standing(located.twist):
                self._begin(MotionState(located.pose))
        if self._state is NavigationState.DRIVING:
            self._look_ahead(located)
        if self._state in (NavigationState.DRIVING, NavigationState.BRAKING):
            return self._drive(located, dt_s)
        if self._state is NavigationState.FOLLOWING:
            return self._follow_on(located, dt_s)
        if self._state is NavigationState.ARRIVING:
            return self._arrive(located, dt_s)
        return self._idle()

    def _idle(self) -> Output:
        return Output(ZERO_TWIST, self._state, self._text)

    def _drive(self, located: Located, dt_s: float) -> Output:
        assert self._trajectory is not None
        rate = self._progress(located, dt_s)
        now = self._trajectory.at(self._elapsed_s)
        error = tracking_error(now.pose, located.pose)
        if self._state is NavigationState.DRIVING and self._lost(error):
            return self._drive(located, 0.0) if self._begin(self._measured(located)) else self._idle()
        if self._elapsed_s >= self._trajectory.duration_s:
            return self._end_of_plan(located)
        t = self._params.tracking
        ahead_s = t.start_ahead_s if self._starting else rate * t.command_delay_s
        ahead = self._trajectory.at(self._elapsed_s + ahead_s)
        most = MotionLimits.of(self._robot.motion(self._passenger)).slower(self._speed_limit)
        twist = bounded(command(now, ahead, located.pose, t, rate), most.speed_mps, most.yaw_rate_radps)
        return Output(twist, self._state, self._text, now.pose, error)

    def _progress(self, located: Located, dt_s: float) -> float:
        """Advances the plan in time. Returns its rate: below 1 the plan waits for the robot."""
        assert self._trajectory is not None
        t = self._params.tracking
        if self._starting:
            start, soon = self._trajectory.at(0.0), self._trajectory.at(t.start_ahead_s)
            self._starting = not begun(start, soon, located.pose, t) and self._since_plan_s < t.start_timeout_s
            return 1.0
        rate = 1.0  # a robot that is held back comes to rest too
        if self._state is NavigationState.DRIVING:
            rate = waiting_rate(self._trajectory.at(self._elapsed_s), located.pose, t)
        self._elapsed_s += rate * dt_s
        return rate

    def _end_of_plan(self, located: Located) -> Output:
        if self._state is NavigationState.BRAKING:
            self._finish(Trigger.END_OF_PLAN, self._text)  # the text has the reason of the stop
            return self._idle()
        self._enter(Trigger.END_OF_PLAN)
        self._settling_s = 0.0
        return self._arrive(located, 0.0)

    def _arrive(self, located: Located, dt_s: float) -> Output:
        goal, stage = self._here, self._stage
        g = self._params.goal
        self._settling_s += dt_s
        error = tracking_error(goal, located.pose)
        late = self._settling_s >= g.settle_s
        # After the settling time the goal tolerance itself suffices.
        near = error.distance_m() <= (g.position_tolerance_m if late else g.settled_position_m)
        turned = abs(error.yaw) <= (g.yaw_tolerance_rad if late else g.settled_yaw_rad)
        if near and turned:
            if self._standing(located.twist):
                if stage is not None and stage.door:
                    self._hold("in the lift")
                    return Output(ZERO_TWIST, self._state, self._text, error=error)
                text = f"goal reached, {1e3 * error.distance_m():.0f} mm off"
                self._end = GoalEnd(GoalStatus.SUCCEEDED, text)
                self._finish(Trigger.REACHED, "goal reached")
                return Output(ZERO_TWIST, self._state, self._text, error=error)
            return Output(ZERO_TWIST, self._state, "stopping at the goal", goal, error)
        if late:
            self._begin(self._measured(located))
            return Output(ZERO_TWIST, self._state, self._text, goal, error)
        limits = self._limits()
        assert limits is not None  # else the tick had found an obstacle
        slow = limits.cruise.slower(SpeedLimit(g.arrival_speed_mps, g.arrival_yaw_rate_radps))
        twist = settle_command(goal, located.pose, slow, self._params.tracking)
        return Output(twist, self._state, "arriving", goal, error)

    # --- lifts -------------------------------------------------------------------------------------------------------

    def _way(self, pose: Pose2, goal: Pose2) -> Stage | Refusal:
        stage = self._lifts.stage(pose, goal)
        if stage is None:
            text = f"no lift leads to the level of goal ({goal.x:.2f}, {goal.y:.2f})"
            return Refusal(GoalCode.NO_VALID_PATH, text)
        if stage.door and not self.around.doors.clear(stage.door, self._footprint(), stage.goal):
            return Refusal(GoalCode.NO_VALID_PATH, f"the robot in the cabin is not clear of door {stage.door!r}")
        return stage

    def _in_lift(self, located: Located | None) -> Ride | None:
        """The ride that goes on. A pose that leaves the cabin, except to the wanted level, ends the goal."""
        ride = None if self._stage is None else self._stage.ride
        if ride is None or located is None:
            return None
        if self._lifts.is_in(ride, ride.start, located.pose):
            return ride
        self._stage = None
        if not self._lifts.is_in(ride, ride.end, located.pose):
            text = f"the pose has left the cabin of lift {ride.lift} during the ride: check it"
            self._withdraw(GoalEnd(GoalStatus.ABORTED, text, GoalCode.FAILED_TO_MAKE_PROGRESS))
        return None

    def _ride(self, ride: Ride, located: Located) -> Output:
        """At rest in the cabin, until its door is open at the wanted level; then the pose goes on there.

        Also while motion is forbidden: between the walls of a closed cabin localization may be lost.
        """
        self._text = self.around.doors.text or f"in lift {ride.lift}: calls level {ride.level}"
        if not (self._standing(located.twist) and self.around.doors.permits(ride.end.door, self._now_s)):
            return self._idle()
        self._text = f"in lift {ride.lift}: changes to level {ride.level} in the map"
        if self._relocated_s < self._params.door.relocation_s:
            return self._idle()
        self._relocated_s = 0.0
        return replace(self._idle(), relocated=ride.arrival(located.pose))

    # --- among obstacles ---------------------------------------------------------------------------------------------

    def _look_ahead(self, located: Located) -> None:
        """On each new costmap, checks that the exact motion is still clear and updates its speed limit.

        Without a costmap on each tick: the motion comes to narrow places and zones of the map."""
        if self._trajectory is None or (self.around.seeing and self._looked == self.around.costmaps):
            return
        self._looked = self.around.costmaps
        if not self._is_direct(self._trajectory, self._elapsed_s, entering=False):
            self._follow(located)
            return
        cruise_mps = self._robot.motion(self._passenger).max_speed_mps
        allowed = allowed_speed(
            self._trajectory, self._elapsed_s, self.around, self._footprint(), self._params, cruise_mps
        )
        if allowed != self._narrow_mps:
            self._narrow_mps = allowed
            self._replan_with_limits()

    def _follow(self, located: Located) -> None:
        """Plans a route around the obstacles and follows it, starting from the last command."""
        goal = self._here
        moves = self._state in (NavigationState.DRIVING, NavigationState.FOLLOWING, NavigationState.BRAKING)
        self._trajectory = None
        self._enter(Trigger.OBSTRUCTED)
        self._narrow_mps, self._since_try_s = math.inf, 0.0
        self._text = self._follower.begin(goal, located, self._footprint(), self._twist if moves else ZERO_TWIST)
        self.path = self._follower.route or _straight(goal, located)

    def _follow_on(self, located: Located, dt_s: float) -> Output:
        assert self._goal is not None
        limits = self._limits()
        assert limits is not None  # else the tick had found an obstacle
        self._since_try_s += dt_s
        if self._since_try_s >= self._params.follow.direct_interval_s:
            self._since_try_s = 0.0
            trajectory = self._motion(moving(located.pose, self._twist), limits)
            if trajectory is not None and self._is_direct(trajectory, 0.0, entering=True):
                self._follower.forget()
                self._enter(Trigger.CLEAR)
                self._run(trajectory, "driving to the goal")
                return self._drive(located, 0.0)
        step = self._follower.step(located, limits, self._footprint(), self._now_s, dt_s)
        if step.unreachable:
            return self._refuse(step.text, located)
        if step.gave_up:
            self._end = GoalEnd(GoalStatus.ABORTED, step.text, GoalCode.PATIENCE_EXCEEDED)
            self._finish(Trigger.GAVE_UP, step.text)
            return self._idle()
        self._text = self.around.doors.text or step.text
        if self._follower.route is not None:
            self.path = self._follower.route
        at_once = self._limits(NO_LIMIT)  # to the limit of the way the follower brakes
        assert at_once is not None
        limit = at_once.cruise
        return Output(bounded(step.twist, limit.speed_mps, limit.yaw_rate_radps), self._state, self._text)

    def _refuse(self, reason: str, located: Located) -> Output:
        """Refuses a goal that the map makes unreachable, as at its reception."""
        assert self._goal is not None
        problem = Refusal(GoalCode.NO_VALID_PATH, reason)
        self._unreachable = _Unreachable(self._goal, self._footprint(), located.pose, problem)
        self._abort(problem)
        return self._drive(located, 0.0) if self._state is NavigationState.BRAKING else self._idle()

    def _known_unreachable(self, goal: Pose2, located: Located | None) -> Refusal | None:
        """Why a goal is already known to be unreachable from about the same place, else None."""
        known = self._unreachable
        if known is None or located is None or not _same(goal, known.goal) or known.footprint != self._footprint():
            return None
        return known.problem if known.start.distance_to(located.pose) < _SAME_START_M else None

    def _is_direct(self, trajectory: Trajectory, from_s: float, *, entering: bool) -> bool:
        return is_direct(
            trajectory, from_s, self.around, self._footprint(), self._params, self._now_s, entering=entering
        )

    @property
    def _here(self) -> Pose2:
        """The goal, or the place on this level to which its way leads first."""
        assert self._goal is not None
        return self._goal if self._stage is None else self._stage.goal

    def _footprint(self) -> Footprint:
        return self._robot.footprint_with_chair if self._passenger else self._robot.footprint

    def _know(self, now_s: float, located: Located | None) -> None:
        self._now_s, self._located = now_s, located
        if located is not None:
            self.around.locate(located)

    # --- goals and plans ---------------------------------------------------------------------------------------------

    def _take(self, goal: Pose2, located: Located | None) -> None:
        if self._goal is not None and _same(goal, self._goal) and self._state is not NavigationState.IDLE:
            return
        start = self._present(located)
        self._goal, self._stage, self._follower.recoveries = goal, None, 0
        # A client may withdraw its goal and send it again after a warning: that is no progress.
        if self._checked_goal is None or not _same(goal, self._checked_goal):
            self._progress_checker.reset()
        self._checked_goal = goal
        if self._state is NavigationState.HELD or start is None or self._limits() is None:
            self._hold("waiting to drive to the goal")
            self.path = _straight(goal, located)
        else:
            self._begin(start)

    def _present(self, located: Located | None) -> MotionState | None:
        """Start of a new plan: on the running plan, so that commands are continuous, else as measured."""
        if self._state in (NavigationState.DRIVING, NavigationState.BRAKING) and self._trajectory is not None:
            return self._trajectory.at(self._elapsed_s)
        if self._state is NavigationState.FOLLOWING and located is not None:
            return moving(located.pose, self._twist)
        return None if located is None else self._measured(located)

    def _measured(self, located: Located) -> MotionState:
        return MotionState(located.pose) if self._standing(located.twist) else moving(located.pose, located.twist)

    def _begin(self, start: MotionState, *, same_way: bool = False) -> bool:
        """Plans from ``start`` to the goal and drives. False on failure, and if it rides in a lift instead; the state
        then gives the reason.
        """
        limits = self._limits()
        if self._goal is None or limits is None:
            self._hold("no limits to drive with")
            return False
        problem = too_far(self._goal, start.pose, self._params.goal)
        stage = Refusal(GoalCode.INVALID, problem) if problem else self._way(start.pose, self._goal)
        if isinstance(stage, Refusal):
            self._abort(stage)
            return False
        self._stage = replace(stage, ride=None)
        rides = stage.ride is not None and self._state is NavigationState.HELD
        if rides and self.around.doors.clear(stage.door, self._footprint(), start.pose):
            self._stage = stage
            self._hold("in the lift")
            return False
        trajectory = self._motion(start, limits)
        if trajectory is None:
            return False
        drives = same_way and self._state is NavigationState.DRIVING
        if self._located is not None and not self._is_direct(trajectory, 0.0, entering=not drives):
            self._follow(self._located)
            return False
        # Another speed does not change a straight path: no need to publish it again.
        keep_path = same_way and self.path is not None and _runs_along(trajectory, self.path)
        self._enter(Trigger.CLEAR)
        self._run(trajectory, "driving to the goal", keep_path=keep_path)
        return True

    def _motion(self, start: MotionState, limits: PlanningLimits) -> Trajectory | None:
        """The exact motion to the goal; None, and HELD with the reason, if there is none."""
        try:
            return plan_motion(start, self._here, limits)
        except ValueError as error:
            self._hold(f"no plan: {error}")
            return None

    def _run(self, trajectory: Trajectory, text: str, *, keep_path: bool = False) -> None:
        self._trajectory, self._text = trajectory, text
        self._elapsed_s = self._since_plan_s = 0.0
        # A robot at rest first turns its wheels, which takes up to half a second: the plan begins when it moves.
        start = trajectory.at(0.0)
        self._starting = start.speed() == 0.0 and start.yaw_rate == 0.0 and trajectory.duration_s > 0.0
        if self._goal is None:
            self.path = None
        elif self.path is None or not keep_path:
            self.path = path_of(trajectory, self._params.plan_spacing_m, self._params.plan_max_poses)

    def _replan_with_limits(self) -> None:
        if self._state not in (NavigationState.DRIVING, NavigationState.BRAKING) or self._trajectory is None:
            return
        now = self._trajectory.at(self._elapsed_s)
        limits = self._limits()
        if limits is None:
            return  # the next tick holds
        if self._state is NavigationState.BRAKING:
            self._run(plan_stop(now, limits.cruise), self._text)
        else:
            self._begin(now, same_way=True)

    def _abort(self, problem: Refusal) -> None:
        self._withdraw(GoalEnd(GoalStatus.ABORTED, f"goal refused: {problem.text}", problem.code))

    def _withdraw(self, end: GoalEnd) -> None:
        self._end = end
        limits, located = self._limits(), self._located
        moves = self._state in (NavigationState.DRIVING, NavigationState.FOLLOWING) and self._twist != ZERO_TWIST
        self._goal = self._stage = None
        self._follower.forget(withdrawn=True)
        if moves and located is not None and limits is not None:
            self._enter(Trigger.WITHDRAWN_MOVING)
            self._run(plan_stop(moving(located.pose, self._twist), limits.cruise), end.text)
        elif self._state is not NavigationState.BRAKING:
            self._finish(Trigger.WITHDRAWN, end.text)

    def _hold(self, text: str) -> None:
        self._follower.forget(withdrawn=True)
        if self._goal is None:
            self._finish(Trigger.BRAKING_FORBIDDEN, text)
            return
        self._trajectory, self._text = None, text
        self._enter(Trigger.FORBIDDEN)

    def _finish(self, trigger: Trigger, text: str) -> None:
        self._goal = self._stage = self._trajectory = self.path = None
        self._enter(trigger)
        self._text = text

    def _enter(self, trigger: Trigger) -> None:
        self._state = target_of(self._state, trigger)

    # --- conditions --------------------------------------------------------------------------------------------------

    def _obstacle(self, situation: Situation) -> str:
        """Why motion is forbidden, else an empty text."""
        if situation.emergency_stop:
            return "emergency stop"
        if situation.located is None:
            return situation.located_problem or "pose unknown"
        if situation.blind:
            return situation.blind
        if self._limits() is None:
            return "speed limit is zero"
        return ""

    def _limits(self, way: SpeedLimit | None = None) -> PlanningLimits | None:
        """way: in place of the limit of the way."""
        limit = self._speed_limit.slower(way or self._way_limit).slower(SpeedLimit(self._narrow_mps, math.inf))
        return planning_limits(self._robot.motion(self._passenger), limit, self._params.limits)

    def _lost(self, error: TrackingError) -> bool:
        t = self._params.tracking
        off = error.distance_m() > t.replan_position_m or abs(error.yaw) > t.replan_yaw_rad
        return off and self._since_plan_s >= t.replan_interval_s

    def _standing(self, twist: Twist2) -> bool:
        p = self._params
        return twist.speed() < p.standing_speed_mps and abs(twist.omega) < p.standing_yaw_rate_radps

    def _step_s(self, now_s: float) -> float:
        """Time since the last tick, s, bounded against clock jumps: a plan neither leaps nor runs back."""
        dt_s = now_s - self._last_tick_s
        self._last_tick_s = now_s
        return min(max(dt_s, 0.0), self._params.tracking.max_step_s) if math.isfinite(dt_s) else 0.0


def _same(a: Pose2, b: Pose2) -> bool:
    error = tracking_error(a, b)
    return error.distance_m() < _SAME_M and abs(error.yaw) < _SAME_RAD


def _runs_along(trajectory: Trajectory, path: Path) -> bool:
    times = (0.2 * i * trajectory.duration_s for i in range(6))
    poses = (trajectory.at(time_s).pose for time_s in times)
    return all(abs(path.project(pose.x, pose.y)[1]) < _SAME_WAY_M for pose in poses)


def _straight(goal: Pose2, located: Located | None) -> Path:
    """The path that is planned once the robot may drive."""
    poses = [goal] if located is None else [located.pose, goal]
    return Path(np.array([(pose.x, pose.y, pose.yaw) for pose in poses]))

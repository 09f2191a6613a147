"""Navigation on drawn courses with walls, gates, boxes and people: arrivals, clearances, time of a step."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from robot_stack.core.config import load
from robot_stack.core.departure import Departure, DepartureParams
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2, exp_se2
from robot_stack.core.people import Person
from robot_stack.core.robot import Footprint, Motion, Robot, load_robot
from robot_stack.core.site_map import Grid
from robot_stack.navigation.cancel_flag import CancelFlag
from robot_stack.navigation.controller import NavigationController, Situation
from robot_stack.navigation.global_planner import GlobalPlanner, NoWay
from robot_stack.navigation.goal import GoalRequest
from robot_stack.navigation.params import NavigationParams
from robot_stack.navigation.planning_grid import PlanningGrid
from robot_stack.navigation.pose_source import Located
from robot_stack.navigation.routes import RouteRequest, RouteResult, RouteSolver
from robot_stack.navigation.warm_up import warm_up
from tests.benchmarks.support.framework import Aim, Result, percentile
from tests.benchmarks.support.navigation_course import COSTMAP_RESOLUTION_M, Course, Sensor, course
from tests.benchmarks.support.navigation_result import CourseResult
from tests.benchmarks.support.navigation_unreachable import Refused, refuse, sites, town
from tests.support.sweeps import SWEEP_S, Sweeps

Array = npt.NDArray[np.float64]

AIMS = {
    "step_ms_p50": Aim("<", 15.0),
    "step_ms_max": Aim("<", 50.0),
    "step_wall_ms_max": Aim("<", 50.0),
    "unreachable_reported_s": Aim("<", 1.0),
    "plan_500m_ms": Aim("<", 200.0),
    "clearance_m_min": Aim(">", 0.1),
    "collisions": Aim("<=", 0.0),
    "success_pct": Aim(">", 98.0),
    "chair_success_pct": Aim(">", 98.0),
    "stops_per_100m": Aim("<", 3.0),
    "known_success_pct": Aim(">=", 100.0),
}
# Fixed courses that serve as a regression test.
_KNOWN = range(1, 51)
_STEP_S, _TICK_S, _COSTMAP_S = 0.01, 0.05, 0.2
_DELAY_S, _COSTMAP_DELAY_S = 0.05, 0.1
_LIMIT_S = 150.0
# Simulated delay of a route after its request; plan_ms_max has the real ones.
_PLAN_S = 0.2
_POSE_SIGMA_M, _POSE_SIGMA_RAD = 0.008, 0.002
_STOPPED_MPS, _MOVING_MPS = 0.03, 0.15


@dataclass
class Body:
    """The holonomic robot: applies commands with a delay and accelerates within the limits of robot.yaml."""

    motion: Motion
    pose: Pose2
    twist: Twist2 = ZERO_TWIST
    _late: deque[Twist2] = field(default_factory=deque)

    def step(self, command: Twist2) -> None:
        self._late.append(command)
        requested = self._late.popleft() if len(self._late) > round(_DELAY_S / _STEP_S) else ZERO_TWIST
        t, m = self.twist, self.motion
        dx, dy = requested.vx - t.vx, requested.vy - t.vy
        size, most = math.hypot(dx, dy), m.max_acceleration_mps2 * _STEP_S
        share = 1.0 if size <= most else most / size
        turn = m.max_yaw_acceleration_radps2 * _STEP_S
        self.twist = Twist2(
            t.vx + share * dx, t.vy + share * dy, t.omega + max(-turn, min(turn, requested.omega - t.omega))
        )
        self.pose = self.pose.compose(exp_se2(self.twist, _STEP_S))


class LateRoutes:
    """The node's planner on simulated time: an answer arrives after ``_PLAN_S``, independent of the computing time.

    plan_ms: CPU time of each route.
    """

    def __init__(self, solver: RouteSolver) -> None:
        self._solver = solver
        self._answer: RouteResult | None = None
        self.now_s = self._due_s = 0.0
        self.plan_ms: list[float] = []

    def ask(self, question: RouteRequest) -> None:
        began = time.thread_time()
        self._answer = self._solver.solve(question, CancelFlag())
        self.plan_ms.append(1e3 * (time.thread_time() - began))
        self._due_s = self.now_s + _PLAN_S

    def take(self) -> RouteResult | None:
        if self.now_s < self._due_s:
            return None
        answer, self._answer = self._answer, None
        return answer

    def drop(self) -> None:
        self._answer = None

    def follow(self, now_s: float) -> None:
        self.now_s = now_s


def drive(made: Course, params: NavigationParams, robot: Robot, seed: int, *, chair: bool = False) -> CourseResult:
    """One course, from its start until the goal is reached, aborted, or the time limit expires."""
    made_routes: list[LateRoutes] = []

    def routes(solver: RouteSolver) -> LateRoutes:
        made_routes.append(LateRoutes(solver))
        return made_routes[0]

    announced = Departure(load(DepartureParams, "departure"), announced=True)
    controller = NavigationController(params, robot, "map", announced, made.grid(), routes)
    return _drive(made, controller, made_routes[0], robot, seed, chair)


def _drive(
    made: Course, controller: NavigationController, routes: LateRoutes, robot: Robot, seed: int, chair: bool
) -> CourseResult:
    random = np.random.default_rng(seed)
    footprint = robot.footprint_with_chair if chair else robot.footprint
    controller.set_passenger(chair)
    body, sensor = Body(robot.motion(chair), made.start), Sensor(made, random)
    result = CourseResult(False, _LIMIT_S, 9.0, 9.0, 0, "", plan_ms=routes.plan_ms, walked=[[] for _ in made.walkers])
    sweeps = Sweeps(robot, np.random.default_rng((seed, 1)))
    costmaps: deque[tuple[float, float, Pose2, npt.NDArray[np.int8], tuple[Person, ...]]] = deque()
    steps, command, sent, touching = 0, ZERO_TWIST, False, False
    while steps * _STEP_S < _LIMIT_S:
        now_s = steps * _STEP_S
        if steps % round(SWEEP_S / _STEP_S) == 0:
            sweeps.sweep(now_s, body.pose, sensor.occupied(), COSTMAP_RESOLUTION_M, 0.0, 0.0)
        if steps % round(_COSTMAP_S / _STEP_S) == 0:
            costmaps.append((now_s + _COSTMAP_DELAY_S, now_s, *sensor.costmap(body.pose), sweeps.people(now_s)))
        if steps % round(_TICK_S / _STEP_S) == 0:
            noise = random.normal(0.0, 1.0, 3) * (_POSE_SIGMA_M, _POSE_SIGMA_M, _POSE_SIGMA_RAD)
            pose = Pose2(body.pose.x + noise[0], body.pose.y + noise[1], body.pose.yaw + noise[2])
            located = Located(pose, body.twist, IDENTITY)
            routes.follow(now_s)
            began, planned = time.thread_time(), len(routes.plan_ms)
            while costmaps and costmaps[0][0] <= now_s:
                _, stamp_s, origin, cells, people = costmaps.popleft()
                controller.around.on_people(stamp_s, people, now_s)
                controller.around.on_costmap(stamp_s, COSTMAP_RESOLUTION_M, origin, cells, now_s)
            if not sent and controller.around.costmaps:
                sent = True
                result.text = controller.request(_goal(made.goal), now_s, located)
            output = controller.tick(Situation(now_s, located, blind=controller.around.problem(now_s)))
            # The node plans in a thread of its own.
            result.step_ms.append(1e3 * (time.thread_time() - began) - sum(routes.plan_ms[planned:]))
            command = output.twist
            result.trace.append((body.pose.x, body.pose.y, body.pose.yaw, body.twist.speed()))
            for one, walked in zip(made.walkers, result.walked, strict=True):
                walked.append((one.x, one.y))
            still, person = made.clearance_m(body.pose, footprint)
            moving = body.twist.speed() > 0.02
            result.clearance_m = min(result.clearance_m, still)
            # A person who walks into a standing robot does not count as a contact.
            result.person_m = min(result.person_m, person) if moving else result.person_m
            touches = still <= 0.0 or (moving and person <= 0.0)
            result.collisions += touches and not touching
            touching = touches
            if output.reached or (sent and controller.goal is None):
                result.reached, result.time_s = output.reached, now_s
                result.text = output.text or result.text
                break
            result.text = output.text
        body.step(command)
        for one in made.walkers:
            one.step(_STEP_S, body.pose, footprint, random)
        steps += 1
    return result


def _goal(pose: Pose2) -> GoalRequest:
    return GoalRequest("map", 0.0, (pose.x, pose.y, 0.0), (0.0, 0.0, math.sin(pose.yaw / 2), math.cos(pose.yaw / 2)))


def long_plan(params: NavigationParams, footprint: Footprint) -> tuple[float, float]:
    """(milliseconds of CPU, metres) of a route of about 500 m through blocks of houses, 300 m x 300 m at 0.1 m."""
    planner = GlobalPlanner(PlanningGrid(Grid(0.1, 0.0, 0.0, town())), params.planner)
    times, length_m = [], 0.0
    for _ in range(5):
        began = time.process_time()
        route = planner.plan(Pose2(0.8, 0.8, 0.0), Pose2(299.0, 299.0, 0.0), footprint)
        times.append(1e3 * (time.process_time() - began))
        assert not isinstance(route, NoWay), route
        length_m = route.length_m
    return percentile(times, 0.5), length_m


def configured() -> NavigationParams:
    return load(NavigationParams, "navigation_controller", {"use_costmap": True})


def courses(seeds: Iterable[int], params: NavigationParams, robot: Robot) -> list[tuple[int, bool, CourseResult]]:
    """(seed, with wheelchair and passenger, result) of each course; even seeds carry wheelchair and passenger."""
    driven = []
    for seed in seeds:
        chair = seed % 2 == 0
        footprint = robot.footprint_with_chair if chair else robot.footprint
        driven.append((seed, chair, drive(course(seed, footprint), params, robot, seed, chair=chair)))
    return driven


def run(fresh: int = 100, first: int = 9001, pictures: str = "results") -> Result:
    """Returns (figures, conditions). fresh: number of courses beside the known ones, from seed ``first`` on, not used
    for tuning; half of them with wheelchair and passenger. pictures: folder for the picture, empty for none.
    """
    params, robot = configured(), load_robot()
    warm_up()
    plan_ms, plan_m = long_plan(params, robot.footprint)
    refused = {name: refuse(cells, params, robot) for name, cells in sites().items()}
    known, new = courses(_KNOWN, params, robot), courses(range(first, first + fresh), params, robot)
    driven = known + new
    if pictures:
        from tests.benchmarks.support.navigation_picture import draw

        draw(driven, Path(pictures) / "navigation.png")
    results = [result for *_, result in driven]
    steps = [ms for result in results for ms in result.step_ms]
    ticks = [ms for item in refused.values() for ms in item.cpu_ms]
    walls = [ms for item in refused.values() for ms in item.wall_ms]
    figures = {
        "step_ms_p50": percentile(steps, 0.5),
        "step_ms_p95": percentile(steps, 0.95),
        "step_ms_max": max(*steps, *ticks),
        "step_wall_ms_max": max(walls),
        "plan_ms_max": max(ms for result in results for ms in result.plan_ms),
        "unreachable_reported_s": max(item.reported_s for item in refused.values()),
        "unreachable_cpu_s": max(item.cpu_s for item in refused.values()),
        "plan_500m_ms": plan_ms,
        "clearance_m_min": min(result.clearance_m for result in results),
        "person_m_min": min(result.person_m for result in results),
        "collisions": float(sum(result.collisions for result in results)),
        "success_pct": _success_pct([item for item in new if not item[1]]),
        "chair_success_pct": _success_pct([item for item in new if item[1]]),
        "known_success_pct": _success_pct(known),
        "time_s_mean": float(np.mean([result.time_s for result in results if result.reached] or [math.nan])),
        "time_over_free": _over_free(driven, params, robot),
        "stops_per_100m": _stops_per_100m(results),
    }
    return Result(figures, _conditions(driven, refused, first, fresh, plan_m))


def _success_pct(driven: list[tuple[int, bool, CourseResult]]) -> float:
    return 100.0 * float(np.mean([float(result.reached) for *_, result in driven] or [math.nan]))


def _stops_per_100m(results: list[CourseResult]) -> float:
    """Full stops on 100 m; the stop at the goal does not count."""
    stops, length_m = 0, 0.0
    for result in results:
        trace = np.array(result.trace)
        length_m += float(np.hypot(*np.diff(trace[:, :2], axis=0).T).sum())
        stops += _stops(trace[:, 3]) - result.reached
    return 100.0 * stops / length_m


def _stops(speed_mps: Array) -> int:
    """How often the speed falls to standstill."""
    state = speed_mps[(speed_mps < _STOPPED_MPS) | (speed_mps > _MOVING_MPS)] > _MOVING_MPS
    return int(np.count_nonzero(state[:-1] & ~state[1:]))


def _conditions(
    driven: list[tuple[int, bool, CourseResult]], refused: dict[str, Refused], first: int, fresh: int, plan_m: float
) -> dict[str, object]:
    return {
        "courses": f"seeds {_KNOWN[0]} to {_KNOWN[-1]}, known, and {first} to {first + fresh - 1}: 32 x 16 m, two "
        "cross walls with gates from 1.3 m, boxes (half not in the map), 3 people walking at 0.6 to 1.4 m/s",
        "success_pct": "the courses from the first seed on, odd seeds, empty robot; chair_success_pct: even seeds, "
        "with wheelchair and passenger",
        "stops_per_100m": f"speeds below {_STOPPED_MPS} m/s after more than {_MOVING_MPS} m/s, over the distance "
        "driven, arrival excluded",
        "robot": f"kinematic, {_DELAY_S} s late, accelerations of robot.yaml, pose noise {_POSE_SIGMA_M} m",
        "costmap": f"{1 / _COSTMAP_S:.0f} Hz, {_COSTMAP_DELAY_S} s old, {COSTMAP_RESOLUTION_M} m, line of sight",
        "people": "from perception's tracker on sweeps of 720 rays in a plane at 10 Hz, 0.02 m of noise",
        "clearance_m_min": "true distance of the footprint to static obstacles; person_m_min: to pedestrians, driving",
        "step_ms": "CPU time of the ticking thread, costmap included; step_wall_ms: real time while a goal is found "
        "unreachable, with what others do on the machine",
        "routes": f"there {_PLAN_S} s of simulated time after the question; plan_ms_max: CPU of the slowest one on a "
        "course, not part of step_ms, because the node plans in a thread of its own",
        "plan_500m_ms": f"CPU, median of 5, {plan_m:.0f} m over 9 million cells",
        "unreachable": {
            name: f"{item.reported_s:.2f} s, {item.times} time(s): {item.text}" for name, item in refused.items()
        },
        "unreachable_reported_s": "the slowest, real time at 20 Hz on 300 m x 300 m, from goal to refusal",
        "time_over_free": "time of a course over that of the same legs without boxes and people",
        "failed": {seed: result.text for seed, _, result in driven if not result.reached},
        "peer": "none: Nav2 is not installed here",
    }


def _over_free(driven: Iterable[tuple[int, bool, CourseResult]], params: NavigationParams, robot: Robot) -> float:
    """Mean ratio of the driving time to the time of the route's length at cruising speed."""
    ratios = []
    for _, chair, result in driven:
        if result.reached:
            points = np.array(result.trace)[:, :2]
            length_m = float(np.hypot(*np.diff(points, axis=0).T).sum())
            motion = robot.motion(chair)
            speed_mps = params.limits.speed_share * min(motion.max_speed_mps, params.limits.cruise_speed_mps)
            ratios.append(result.time_s / (length_m / speed_mps + speed_mps / motion.max_acceleration_mps2))
    return float(np.mean(ratios)) if ratios else math.nan

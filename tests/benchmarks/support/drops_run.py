"""One run of the benchmark ``drops``: plays a case and checks the ground under the wheels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot_stack.contract.faults import join_codes
from robot_stack.core.geometry import ZERO_TWIST, Pose2
from sim.lidar.params import load_lidar_params
from tests.benchmarks.support.drops_cases import SETTLE_S, Case, contacts
from tests.benchmarks.support.people_stage import STEP_S, Stage
from tests.benchmarks.support.people_terrain import inside, terrain_of

_DEEP_M = 0.04  # the wheels can pass 3 cm
_ATTITUDE_SIGMA_RAD = 0.004  # of the inertial unit, config/imu_driver.yaml
_SHORT_M = 0.1


@dataclass(frozen=True, slots=True)
class Outcome:
    """over: a wheel or castor crossed an edge; at_mps: the robot's speed at that moment.

    distance_m: driven distance. stops: where and why the limit became 0. reason: of the limit at the end.
    """

    case: Case
    over: bool
    at_mps: float
    distance_m: float
    stops: tuple[str, ...]
    reason: str

    @property
    def passed(self) -> bool:
        """True if a passable route was driven to its end without a stop."""
        return not self.stops and self.distance_m >= self.case.to_m - _SHORT_M


def play(case: Case, *, guarded: bool = True) -> Outcome:
    """guarded: if False, the safety monitor's limit is ignored."""
    random = np.random.default_rng([case.seed, 3])
    roll, pitch = random.normal(0.0, _ATTITUDE_SIGMA_RAD, 2)
    terrain = terrain_of(case.world, load_lidar_params(), (float(roll), float(pitch)))
    stage = Stage(case.seed, [], {}, chair=case.chair, guarded=guarded, terrain=terrain)
    stage.body.pose = case.start
    if case.chair and case.legs[0].requested.vx > 0.1:
        stage.drive_in()
    stage.requested = ZERO_TWIST
    distance_m, legs, leg, stopped, stops = 0.0, iter(case.legs), None, False, list[str]()
    for step in range(round(case.run_s / STEP_S)):
        if step * STEP_S >= SETTLE_S and (leg is None or distance_m >= leg.until_m):
            leg = next(legs)
            stage.requested = leg.requested
        stage.advance()
        distance_m += stage.body.twist.speed() * STEP_S
        asked = leg is not None and leg.requested != ZERO_TWIST and distance_m > 0.0
        stops_now = asked and stage.verdict.limit.linear_mps == 0.0
        if stops_now and not stopped:
            stops.append(f"{distance_m:.1f} m: {reported(stage)}")
        stopped = stops_now
        if _over(case, stage.body.pose):
            return Outcome(case, True, stage.body.twist.speed(), distance_m, tuple(stops), reported(stage))
    return Outcome(case, False, 0.0, distance_m, tuple(stops), reported(stage))


def reported(stage: Stage) -> str:
    limit = stage.verdict.limit
    return f"{limit.linear_mps:.2f} m/s {join_codes(limit.codes)} {'; '.join(stage.monitor.details.values())}"


def _over(case: Case, pose: Pose2) -> bool:
    wheels = contacts(chair=case.chair).tolist()
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return any(
        inside(pit, pose.x + c * u - s * v, pose.y + s * u + c * v)
        for pit in case.world.pits
        if pit.depth_m > _DEEP_M
        for u, v in wheels
    )

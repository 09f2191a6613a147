"""One run of the benchmark ``people``: plays a case and classifies its contacts."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2, exp_se2
from robot_stack.core.robot import Robot
from robot_stack.core.twist_limits import brake
from robot_stack.drive.arbitration import Source
from robot_stack.safety.collision import Outline, approach, outline_of
from robot_stack.safety.collision_prediction import rests
from robot_stack.safety.obstacle_params import CollisionParams
from tests.benchmarks.support.people_bodies import Body, Walker, contact
from tests.benchmarks.support.people_cases import Case
from tests.benchmarks.support.people_senses import chair_ahead
from tests.benchmarks.support.people_stage import REACTION_S, STEP_S, Stage

# A body that passes at this distance must not stop the robot; a nearer one may.
PASSING_M = 0.5
MOVING_MPS = 0.02  # of the outline at the contact
_AHEAD_S = 1.2  # reaction and braking from 1.5 m/s, and room to spare
_WHO = "who"
_DOCKED_M = 0.02  # the latch closes from here on


@dataclass(frozen=True, slots=True)
class Touch:
    """The first contact while the robot moves. speed_mps: greatest speed of the outline at a contact of the run.

    closing_mps: greatest speed of the outline towards the body at a contact of the run; negative: it only moved away.
    pushed_m: way of the outline towards the body during contact. x, y: of the first contact, base_link. at_s: from the
    start of the run. stood: the body stood at its target. faults: of the verdict at that time.
    """

    speed_mps: float
    closing_mps: float
    pushed_m: float
    x: float
    y: float
    at_s: float
    stood: bool
    faults: tuple[str, ...]
    avoidable: bool = True


@dataclass(frozen=True, slots=True)
class Outcome:
    """touch: None if the robot stood at every contact. near_m: the least gap. distance_m: driven by the robot."""

    case: Case
    touch: Touch | None
    near_m: float
    distance_m: float


@dataclass(frozen=True, slots=True)
class Moment:
    """State of robot and walker at one step."""

    pose: Pose2
    twist: Twist2
    walker: Walker


def play(case: Case, *, guarded: bool = True) -> Outcome:
    """guarded: if False, the safety monitor's limit is ignored."""
    stage = Stage(case.seed, [], {_WHO: case.body.shapes}, chair=case.chair, dock=case.dock, guarded=guarded)
    if case.chair:
        stage.drive_in()
    stage.source = Source.DOCKING if case.manoeuvre == "dock" else Source.TELEOP
    walker, moments = replace(case.walker), list[Moment]()
    near_m, distance_m, touch = math.inf, 0.0, None
    for step in range(round(case.run_s / STEP_S)):
        _walk(walker, case.body, stage.outline, stage.body.pose, stage.body.twist)
        stage.poses[_WHO] = walker.pose
        stage.requested = _requested(case, step * STEP_S, stage.body.pose)
        stage.advance()
        moments.append(Moment(stage.body.pose, stage.body.twist, replace(walker)))
        met = contact(case.body, stage.seen_from_robot(_WHO), stage.outline)
        near_m, distance_m = min(near_m, met.gap_m), distance_m + stage.body.twist.speed() * STEP_S
        speed_mps = met.speed_mps(stage.body.twist)
        if met.gap_m <= 0.0 and speed_mps > MOVING_MPS:
            closing_mps = met.closing_mps(stage.body.twist)
            if touch is None:
                faults = stage.verdict.faults
                touch = Touch(speed_mps, closing_mps, 0.0, met.x, met.y, step * STEP_S, walker.arrived, faults)
            touch = replace(
                touch,
                speed_mps=max(touch.speed_mps, speed_mps),
                closing_mps=max(touch.closing_mps, closing_mps),
                pushed_m=touch.pushed_m + max(closing_mps, 0.0) * STEP_S,
            )
    if touch is not None:
        could = avoidable(case, moments[: round(touch.at_s / STEP_S) + 1], stage.robot, stage.params.collision)
        touch = replace(touch, avoidable=could)
    return Outcome(case, touch, near_m, distance_m)


def _requested(case: Case, at_s: float, robot: Pose2) -> Twist2:
    docked = case.dock is not None and robot.x >= case.dock.x - chair_ahead().x - _DOCKED_M
    return case.requested if at_s >= case.request_s and not docked else ZERO_TWIST


def _walk(walker: Walker, body: Body, outline: Outline, robot: Pose2, twist: Twist2) -> None:
    """Moves the walker by one step, but not further into the robot."""
    before = replace(walker)
    walker.step(STEP_S, robot, twist)
    gap_m = contact(body, walker.pose.relative_to(robot), outline).gap_m
    if gap_m <= 0.0 and gap_m < contact(body, before.pose.relative_to(robot), outline).gap_m <= 0.0:
        walker.pose, walker.remaining_m = before.pose, before.remaining_m


def avoidable(case: Case, moments: list[Moment], robot: Robot, params: CollisionParams) -> bool:
    """True if an ideal observer with the robot's reaction time could have stopped before the last moment's contact.

    The ideal observer has exact positions and velocities and no intentions. It brakes if a body is nearer than
    ``PASSING_M`` to the outline, or will be so within ``_AHEAD_S`` if both keep their velocities, or if the motion
    leads to it by the safety monitor's own thresholds.
    """
    outline = outline_of(robot.footprint_with_chair if case.chair else robot.footprint)
    alarm = next(i for i, moment in enumerate(moments) if _alarming(case.body, moment, outline, params))
    begin = alarm + round(REACTION_S / STEP_S)
    if begin >= len(moments):
        return False
    pose, twist, walker = moments[begin].pose, moments[begin].twist, replace(moments[begin].walker)
    turning_radps2 = robot.emergency_deceleration_mps2 / outline.reach()
    for _ in range(len(moments) - begin + round(1.0 / STEP_S)):
        _walk(walker, case.body, outline, pose, twist)
        twist = brake(twist, robot.emergency_deceleration_mps2, turning_radps2, STEP_S)
        pose = pose.compose(exp_se2(twist, STEP_S))
        met = contact(case.body, walker.pose.relative_to(pose), outline)
        if met.gap_m <= 0.0 and met.speed_mps(twist) > MOVING_MPS:
            return False
    return True


def _alarming(body: Body, moment: Moment, outline: Outline, params: CollisionParams) -> bool:
    seen = moment.walker.pose.relative_to(moment.pose)
    walks_mps = 0.0 if moment.walker.arrived else moment.walker.speed_mps
    for after_s in np.arange(0.0, _AHEAD_S, 0.05):
        walker = moment.walker.pose.compose(Pose2(walks_mps * after_s, 0.0, 0.0))
        robot = moment.pose.compose(exp_se2(moment.twist, after_s))
        if contact(body, walker.relative_to(robot), outline).gap_m < PASSING_M:
            return True
    if rests(moment.twist, params):
        return False
    points = body.outline(seen)
    ahead = approach(np.column_stack([points, np.ones(len(points))]), outline, moment.twist)
    return ahead.time_s < params.stop_s or ahead.clearance_m < params.stop_clearance_m

"""Predicted contacts of the robot's motion: measured, commanded and requested twists against the points around it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.core.robot import Motion
from robot_stack.safety.collision import FREE, Approach, Floats, Outline, approach
from robot_stack.safety.obstacle_params import CollisionParams
from robot_stack.safety.pedestrian_collision import NO_COLLISION, PedestrianCollision


@dataclass(frozen=True, slots=True)
class CollisionPrediction:
    """moving: approach of the measured and commanded motion. wanted: of the requested motion of a standing robot.

    unseen: of any of them to the end of known space. nearest_m: distance of the nearest obstacle to the footprint,
    infinite without one. reach_m: largest distance of the footprint from base_link. brake_mps2: the robot's largest
    deceleration. motion: of a ride, by which the drive follows a limit that falls. no_ground: approach of a motion
    ahead to the end of known ground. measured: the twist by the wheels.
    """

    moving: Approach
    wanted: Approach
    unseen: Approach
    nearest_m: float
    reach_m: float
    brake_mps2: float
    motion: Motion
    pedestrian_collision: PedestrianCollision = NO_COLLISION
    no_ground: Approach = FREE
    measured: Twist2 = ZERO_TWIST

    def worse(self, other: CollisionPrediction) -> CollisionPrediction:
        """Combines the same motions of two outlines: the nearer contacts and obstacles, and the longer reach."""
        return replace(
            self,
            moving=self.moving.worse(other.moving),
            wanted=self.wanted.worse(other.wanted),
            unseen=self.unseen.worse(other.unseen),
            nearest_m=min(self.nearest_m, other.nearest_m),
            reach_m=max(self.reach_m, other.reach_m),
        )

    @property
    def clearance_m(self) -> float:
        return min(self.moving.clearance_m, self.wanted.clearance_m)

    @property
    def time_s(self) -> float:
        return min(self.moving.time_s, self.wanted.time_s)

    def no_faster_than(self, speed_mps: float) -> bool:
        """Measured speed of base_link, and of the farthest corner by the turn alone. False for a twist with NaN."""
        return self.measured.speed() <= speed_mps and abs(self.measured.omega) * self.reach_m <= speed_mps


def look_ahead(
    points: Floats,
    unseen: Floats | None,
    body: Outline,
    widened: Outline,
    measured: Twist2,
    driven: Twist2 | None,
    requested: Twist2,
    params: CollisionParams,
    brake_mps2: float,
    motion: Motion,
) -> CollisionPrediction:
    """Judges the motions, base_link.

    Args:
        points: (n, 3) obstacles in base_link, m. unseen: the end of known space; None if unknown.
        body, widened: the footprint in force, and the same with the margin.
        measured: by the wheels, zero if the robot stands or this is unknown.
        driven: the drive's own command; None if it publishes none: then ``requested`` replaces it.
        requested: the command to the drive. It counts beside ``driven`` only while that is a standstill: a robot
            that is held back must not jerk each time the obstacle ahead disappears for a moment.
    """
    commanded = requested if driven is None else driven
    moving = _judge(points, widened, measured, params).worse(_judge(points, widened, commanded, params))
    wanted = _judge(points, widened, requested, params) if rests(commanded, params) else FREE
    leading = [twist for twist in (measured, commanded, requested) if not rests(twist, params)]
    nearest_m = float(body.distances(points).min()) if len(points) else math.inf
    return CollisionPrediction(
        moving=moving,
        wanted=wanted,
        unseen=_into_unseen(unseen, widened, leading),
        nearest_m=nearest_m,
        reach_m=body.reach(),
        brake_mps2=brake_mps2,
        motion=motion,
        measured=measured,
    )


def speed_limit_mps(clearance_m: float, params: CollisionParams, brake_mps2: float) -> float:
    """Allowed speed with this clearance ahead, m/s."""
    stoppable_mps = _stoppable_mps(clearance_m - params.stop_clearance_m, params.reaction_s, brake_mps2, params)
    in_time_mps = math.floor(clearance_m / params.approach_s / params.step_mps) * params.step_mps
    return max(params.slowest_mps, min(in_time_mps, stoppable_mps))


def seen_limit_mps(clearance_m: float, params: CollisionParams, motion: Motion) -> float:
    """Allowed speed to stop within this length of way that is seen or remembered, m/s.

    The drive follows the limit as in a ride, within acceleration and jerk. Emergency braking remains for what appears.
    """
    return max(params.unseen_mps, _slowed_mps(clearance_m - params.margin_m, params, motion))


def ground_limit_mps(clearance_m: float, params: CollisionParams, motion: Motion) -> float:
    """Allowed speed to stop as in a ride before known ground ends, m/s; 0 at the latest ``ground_margin_m`` before."""
    return _slowed_mps(clearance_m - params.ground_margin_m, params, motion)


def onto_no_ground(ends: Floats | None, body: Outline, twists: Sequence[Twist2], params: CollisionParams) -> Approach:
    """Approach of the motions that lead ahead to (n, 3) points where known ground ends; None: none is known."""
    return _into_unseen(ends, body, [twist for twist in twists if twist.vx > params.rest_mps])


def rests(twist: Twist2, params: CollisionParams) -> bool:
    """A twist so small that it is a standstill."""
    return twist.speed() <= params.rest_mps and abs(twist.omega) <= params.rest_radps


def _slowed_mps(way_m: float, params: CollisionParams, motion: Motion) -> float:
    jerk_s = motion.max_acceleration_mps2 / motion.max_jerk_mps3
    return _stoppable_mps(way_m, params.reaction_s + jerk_s, motion.max_acceleration_mps2, params)


def _stoppable_mps(way_m: float, reaction_s: float, brake_mps2: float, params: CollisionParams) -> float:
    """Speed that stops within the way, in steps, so that a noisy way does not change the limit at every tick."""
    lost = brake_mps2 * reaction_s
    speed_mps = math.sqrt(lost * lost + 2.0 * brake_mps2 * max(way_m, 0.0)) - lost
    return math.floor(speed_mps / params.step_mps) * params.step_mps


def _into_unseen(unseen: Floats | None, outline: Outline, twists: Sequence[Twist2]) -> Approach:
    worst = FREE
    for twist in twists:
        worst = worst.worse(Approach(0.0, 0.0) if unseen is None else approach(unseen, outline, twist))
    return worst


def _judge(points: Floats, outline: Outline, twist: Twist2, params: CollisionParams) -> Approach:
    return FREE if rests(twist, params) else approach(points, outline, twist)

"""What the robot's motion leads to: measured, commanded and requested twists against the points around it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.safety.collision import FREE, Approach, Floats, Outline, approach
from robot_stack.safety.meeting import NOBODY, Meeting
from robot_stack.safety.obstacle_params import CollisionParams


@dataclass(frozen=True, slots=True)
class CollisionPrediction:
    """moving: what the robot does and is about to do. wanted: what a standing robot is asked to do.

    unseen: how either of them comes near where known space ends. nearest_m: distance of the nearest obstacle to the
    footprint, infinite without one. reach_m: how far the footprint reaches from base_link. brake_mps2: how hard the
    robot can brake. meeting: who walks into its way. no_ground: how a motion ahead comes near where known ground ends.
    measured: the twist by the wheels.
    """

    moving: Approach
    wanted: Approach
    unseen: Approach
    nearest_m: float
    reach_m: float
    brake_mps2: float
    meeting: Meeting = NOBODY
    no_ground: Approach = FREE
    measured: Twist2 = ZERO_TWIST

    def worse(self, other: CollisionPrediction) -> CollisionPrediction:
        """The same motions of another outline: of both the nearer contacts and obstacles, and the longer reach."""
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
        """Measured: base_link, and the farthest corner by the turn alone. False for a twist that is no number."""
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
) -> CollisionPrediction:
    """Judges the motions, base_link.

    Args:
        points: (n, 3) obstacles in base_link, m. unseen: where known space ends; None: nobody knows.
        body, widened: the footprint in force, and the same with the margin.
        measured: by the wheels, zero where the robot stands or nobody knows.
        driven: what the drive tries to do; None if it does not say: then ``requested`` takes its place.
        requested: what the drive is asked to do. It counts beside ``driven`` only while that is a standstill: a robot
            that is held back must not lurch each time the obstacle that holds it seems to be gone.
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
        measured=measured,
    )


def speed_limit_mps(clearance_m: float, params: CollisionParams, brake_mps2: float) -> float:
    """How fast the robot may go with so much way left, m/s."""
    stoppable_mps = _stoppable_mps(clearance_m - params.stop_clearance_m, params, brake_mps2)
    in_time_mps = math.floor(clearance_m / params.approach_s / params.step_mps) * params.step_mps
    return max(params.slowest_mps, min(in_time_mps, stoppable_mps))


def seen_limit_mps(clearance_m: float, params: CollisionParams, brake_mps2: float) -> float:
    """How fast the robot may go to stop within so much of a way that is seen or remembered, m/s."""
    return max(params.unseen_mps, _stoppable_mps(clearance_m - params.margin_m, params, brake_mps2))


def ground_limit_mps(clearance_m: float, params: CollisionParams, brake_mps2: float) -> float:
    """How fast the robot may go to stop before known ground ends, m/s; 0 at the latest ``ground_margin_m`` before."""
    return _stoppable_mps(clearance_m - params.ground_margin_m, params, brake_mps2)


def onto_no_ground(ends: Floats | None, body: Outline, twists: Sequence[Twist2], params: CollisionParams) -> Approach:
    """How those of the motions that lead ahead come near (n, 3) points where known ground ends; None: none is known."""
    return _into_unseen(ends, body, [twist for twist in twists if twist.vx > params.rest_mps])


def rests(twist: Twist2, params: CollisionParams) -> bool:
    """A twist so small that it is a standstill."""
    return twist.speed() <= params.rest_mps and abs(twist.omega) <= params.rest_radps


def _stoppable_mps(way_m: float, params: CollisionParams, brake_mps2: float) -> float:
    """In steps, so that a noisy way is no new limit at every tick."""
    lost = brake_mps2 * params.reaction_s
    speed_mps = math.sqrt(lost * lost + 2.0 * brake_mps2 * max(way_m, 0.0)) - lost
    return math.floor(speed_mps / params.step_mps) * params.step_mps


def _into_unseen(unseen: Floats | None, outline: Outline, twists: Sequence[Twist2]) -> Approach:
    worst = FREE
    for twist in twists:
        worst = worst.worse(Approach(0.0, 0.0) if unseen is None else approach(unseen, outline, twist))
    return worst


def _judge(points: Floats, outline: Outline, twist: Twist2, params: CollisionParams) -> Approach:
    return FREE if rests(twist, params) else approach(points, outline, twist)

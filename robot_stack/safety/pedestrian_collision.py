"""Pedestrian collision: moving bodies against a robot that continues, or brakes.

A contact with a standing robot is harmless, so the criterion is whether the robot can stop before a contact. Each
motion is predicted with the bodies' velocities until the standstill of a robot that brakes now. The stop is requested
at the last moment that is still in time, and the speed is limited so that this moment is some time ahead. If
continuing touches no body, the robot continues: braking would only bring a person who walks behind it nearer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.safety.collision import Floats, Outline
from robot_stack.safety.obstacle_params import PedestrianCollisionParams
from robot_stack.safety.timing import age_s

_TINY = 1e-9


@dataclass(frozen=True, slots=True)
class PedestrianCollision:
    """stop: the robot must stop for a pedestrian. speed_mps: limit of the footprint's fastest point, or inf."""

    stop: bool = False
    speed_mps: float = math.inf


NO_COLLISION = PedestrianCollision()


class PedestrianCollisionWatch:
    """Call ``judge`` at every tick, steady s. Remembers a person who has just walked up, because the motion of people
    beside the robot is not observed: while an obstacle is beside it, it holds for ``hold_s`` to let them go on.

    An obstacle that is gone from one tick to the next was not seen leaving: a pole that leans on the chair returns
    nothing, because its place counts as the chair's. It counts as beside the robot until something else is."""

    def __init__(self, params: PedestrianCollisionParams, brake_mps2: float) -> None:
        self._params, self._brake_mps2 = params, brake_mps2
        self._came_s: float | None = None
        self._beside_m = math.inf  # of the nearest obstacle, unless it was lost from there

    def judge(
        self, moving: Floats, nearest_m: float, body: Outline, motions: list[Twist2], request: Twist2, now_s: float
    ) -> PedestrianCollision:
        """moving: (n, 5) x, y, z, vx, vy in base_link, over ground. nearest_m: of all obstacles, to the footprint.

        motions: measured and commanded. request: the requested one.
        """
        p, requests = self._params, _fastest_mps(request, body)
        share = self._share(moving, body, request)
        stop = share == 0.0 or any(self._too_late(moving, body, twist) for twist in motions)
        if self._arrives(moving, body):
            self._came_s = now_s
        if not nearest_m - self._beside_m > p.leaves_m or not self._waits(now_s):
            self._beside_m = nearest_m
        held = self._waits(now_s) and self._beside_m <= p.beside_m
        return PedestrianCollision(stop or (held and requests > _TINY), share * requests if share < 1.0 else math.inf)

    def _waits(self, now_s: float) -> bool:
        return age_s(now_s, self._came_s) <= self._params.hold_s

    def _arrives(self, moving: Floats, body: Outline) -> bool:
        """True if a body is about to reach the present footprint, whatever the robot's motion."""
        times = np.arange(0.0, self._params.ahead_s + self._params.step_s, self._params.step_s)
        gaps = _gaps(moving, body, ZERO_TWIST, times, np.zeros_like(times))
        return bool((gaps <= self._params.margin_m + _drifts_mps(moving, self._params) * times).any())

    def _too_late(self, moving: Floats, body: Outline, twist: Twist2) -> bool:
        """True if the robot touches a body before its standstill, even if it brakes now, and also without braking."""
        return self._touches(moving, body, twist, 1.0, self._params.reaction_s) and self._touches(
            moving, body, twist, 1.0, None
        )

    def _share(self, moving: Floats, body: Outline, request: Twist2) -> float:
        """The greatest share of a motion's speed that needs no stop now; 0: there is none."""
        p = self._params
        for step in range(p.shares, 0, -1):
            share = step / p.shares
            if not self._touches(moving, body, request, share, p.reaction_s + p.ahead_s):
                return share
            if not self._touches(moving, body, request, share, None):
                return share
        return 0.0

    def _touches(self, moving: Floats, body: Outline, twist: Twist2, share: float, brakes_s: float | None) -> bool:
        """True if a body touches a robot that continues with a share of the twist and brakes after ``brakes_s``, before
        it stands. None: it does not brake, and is predicted to the horizon."""
        p = self._params
        speed_mps = share * _fastest_mps(twist, body)
        if speed_mps <= _TINY or not len(moving):
            return False
        last_s = p.horizon_s if brakes_s is None else min(brakes_s + speed_mps / self._brake_mps2, p.horizon_s)
        times = np.arange(0.0, last_s + p.step_s, p.step_s)
        reached = share * times
        if brakes_s is not None:
            braking = np.clip(times - brakes_s, 0.0, speed_mps / self._brake_mps2)
            driven = np.minimum(times, brakes_s) + braking - 0.5 * self._brake_mps2 / speed_mps * braking**2
            reached = share * driven
        near = _gaps(moving, body, twist, times, reached) <= p.margin_m + _drifts_mps(moving, p) * times
        return bool(near.any())


def _fastest_mps(twist: Twist2, body: Outline) -> float:
    """An upper bound of the speed of all points of the footprint, m/s."""
    return twist.speed() + abs(twist.omega) * body.reach()


def _drifts_mps(moving: Floats, params: PedestrianCollisionParams) -> Floats:
    """(n, 1) m/s: growth of the error of the predicted positions of (n, 5) points."""
    speeds = np.hypot(moving[:, 3], moving[:, 4])
    drifts: Floats = np.maximum(params.drift_mps, params.drift_share * speeds)[:, None]
    return drifts


def _gaps(moving: Floats, body: Outline, twist: Twist2, times: Floats, reached: Floats) -> Floats:
    """(n, k) m from (n, 5) points at (k,) moments to the footprint of a robot that has followed the twist so far."""
    x, y, turned = _along(twist, reached)
    dx = moving[:, 0, None] + moving[:, 3, None] * times - x
    dy = moving[:, 1, None] + moving[:, 4, None] * times - y
    c, s = np.cos(turned), np.sin(turned)
    u, v = c * dx + s * dy, c * dy - s * dx
    ahead = np.maximum(np.maximum(u - body.front, body.rear - u), 0.0)
    gaps: NDArray[np.float64] = np.hypot(ahead, np.maximum(np.abs(v) - body.half, 0.0))
    return gaps


def _along(twist: Twist2, seconds: Floats) -> tuple[Floats, Floats, Floats]:
    """(k,) x, y and yaw of base_link after (k,) seconds of a twist."""
    turned = twist.omega * seconds
    sine, cosine = np.sinc(turned / math.pi) * seconds, 0.5 * turned * np.sinc(0.5 * turned / math.pi) ** 2 * seconds
    return twist.vx * sine - twist.vy * cosine, twist.vx * cosine + twist.vy * sine, turned

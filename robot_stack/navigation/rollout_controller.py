"""The local controller: a few hundred motions along the route, rolled out and scored; the best is refined and driven.

Cross-entropy optimisation over three numbers (offset beside the route, share of the speed, heading offset): first a
fixed grid of candidates including standstill, then draws around the best. The draws depend only on the seed and the
number of the step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.limits import MotionLimits
from robot_stack.core.robot import Footprint
from robot_stack.navigation.footprint import box_of, outline
from robot_stack.navigation.local_map import LocalMap
from robot_stack.navigation.params import LocalParams
from robot_stack.navigation.rollout_kernels import COLLISION, evaluate, free_time

Array = npt.NDArray[np.float64]
_SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
_TURNS = (-0.35, 0.0, 0.35)
_SLOWER = (1.0, 0.8, 0.6, 0.45, 0.3, 0.2, 0.1)


@dataclass(frozen=True, slots=True)
class Choice:
    """twist: to be reached within a step of the rollout. blocked: only standstill is free.

    urgent: slowed down because of a near obstacle: brake as hard as allowed.
    """

    twist: Twist2
    blocked: bool
    offset_m: float
    urgent: bool


class RolloutController:
    """Its only state is the last choice, which gets a small preference, and the number of the step."""

    def __init__(self, params: LocalParams) -> None:
        self._params = params
        offsets = np.linspace(-params.max_offset_m, params.max_offset_m, params.offsets)
        grid = [(d, s, 0.0) for d in offsets for s in _SHARES[1:]]
        grid += [(0.0, s, h) for s in (0.3, 1.0) for h in _TURNS if h]
        self._grid = np.array([(0.0, 0.0, 0.0), *grid])
        self._random = np.random.default_rng(params.seed)
        self._last = np.zeros(3)

    def reset(self) -> None:
        self._last = np.zeros(3)
        self._random = np.random.default_rng(self._params.seed)

    def step(
        self,
        pose: Pose2,
        twist: Twist2,
        route: Array,
        limits: MotionLimits,
        footprint: Footprint,
        local: LocalMap,
        people: Array,
    ) -> Choice:
        """pose: costmap's frame. twist: base_link. route: (n, 5) x, y, yaw, along, speed. people: (m, 6)."""
        p = self._params
        at, now = np.array([pose.x, pose.y, pose.yaw]), np.array([twist.vx, twist.vy, twist.omega])
        bounds = np.array(
            [limits.speed_mps, limits.yaw_rate_radps, limits.acceleration_mps2, limits.yaw_acceleration_radps2]
        )
        edge, box, reach = outline(footprint), box_of(footprint), _reach(footprint)
        field, hard = local.leaving(edge, at, p.hard_margin_m, 0.02)
        place = field, local.resolution_m, local.x_m, local.y_m

        def judge(candidates: Array) -> tuple[Array, Array, Array]:
            result: tuple[Array, Array, Array] = evaluate(
                candidates, route, at, now, bounds, p.step_s, p.steps, *place, edge, box, reach,
                hard, p.soft_margin_m, people, p.person_margin_m, np.array(p.weights),
                float(self._last[0]),
            )  # fmt: skip
            return result

        candidates = np.vstack((self._grid, self._last))
        costs, firsts, _ = judge(candidates)
        spread = np.array(p.spread)
        for _ in range(p.rounds):
            best = candidates[np.argsort(costs)[: p.elite]]
            drawn = best[self._random.integers(len(best), size=p.samples)]
            drawn = drawn + spread * self._random.standard_normal((p.samples, 3))
            drawn[:, 0] = np.clip(drawn[:, 0], -p.max_offset_m, p.max_offset_m)
            drawn[:, 1] = np.clip(drawn[:, 1], 0.0, 1.0)
            drawn[:, 2] = np.clip(drawn[:, 2], -p.max_turn_rad, p.max_turn_rad)
            more_costs, more_firsts, _ = judge(drawn)
            candidates, costs = np.vstack((candidates, drawn)), np.concatenate((costs, more_costs))
            firsts, spread = np.vstack((firsts, more_firsts)), 0.5 * spread
        pick = int(np.argmin(costs))
        self._last = candidates[pick].copy()
        standing = bool(self._last[1] < 0.02)
        requested = Twist2(*map(float, firsts[pick]))
        if costs[pick] >= 0.4 * COLLISION and people.size == 0:
            requested, standing = Twist2(0.0, 0.0, 0.0), True
        governed, _ = self.governed(pose, requested, footprint, local, people, p.governor_margin_m)
        return Choice(governed, standing, float(self._last[0]), governed is not requested)

    def governed(
        self, pose: Pose2, requested: Twist2, footprint: Footprint, local: LocalMap, people: Array, margin_m: float
    ) -> tuple[Twist2, bool]:
        """``requested``, slowed down until its unchanged continuation stays clear for the horizon, the criterion of
        the safety monitor; and whether it does.

        pose: costmap's frame. people: (m, 6). margin_m: to static obstacles.
        """
        p = self._params
        at, edge, box = np.array([pose.x, pose.y, pose.yaw]), outline(footprint), box_of(footprint)
        field, margin_m = local.leaving(edge, at, margin_m, 0.03)
        place = field, local.resolution_m, local.x_m, local.y_m
        slower = requested
        for share in _SLOWER:
            slower = requested if share == 1.0 else requested.scaled(share)
            twist = np.array([slower.vx, slower.vy, slower.omega])
            free_s = free_time(*place, edge, at, twist, margin_m, p.governor_s, box, people)
            if free_s >= p.governor_s:
                return slower, True
        return slower, False


def _reach(footprint: Footprint) -> float:
    return float(np.hypot(0.5 * (footprint.front_m - footprint.rear_m), 0.5 * footprint.width_m))

"""The side on which the robot passes people who come along its way.

A robot in the middle of a corridor leaves room for people on neither side of it: they stop before it, and it before
them. Beside its route it leaves one lane that is wide enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from robot_stack.core.people import Person
from robot_stack.core.robot import Footprint
from robot_stack.navigation.params import PassingParams

Array = npt.NDArray[np.float64]
# Cosine of the angle to the way up to which a person comes along it.
_ALONG = math.cos(math.pi / 4)
_STEP_M = 0.1
# In metres of room: a metre beside the route, and a metre of change.
_BESIDE, _CHANGE = 0.1, 0.15
# The prediction of a person's sideways motion is bounded to this time.
_DRIFT_S = 3.0
_SLOWEST_MPS = 0.3
_BEFORE_M = 0.5


def course(route: Array) -> Array:
    """(n, 2) unit vectors along (n, 2+) points of a route."""
    steps = np.gradient(route[:, :2], axis=0)
    return np.asarray(steps / np.maximum(np.hypot(*steps.T), 1e-9)[:, None])


def comes_along(one: Person, direction: Array) -> bool:
    """True for a person who walks against a direction (2,) of the robot's way, and not across it."""
    vx, vy = one.velocity
    return float(vx * direction[0] + vy * direction[1]) < -_ALONG * math.hypot(vx, vy)


class PassingSide:
    """The offset beside the route for people who come, or who have stopped on their way; kept until they have passed.

    offset_m: to the left of the route, 0 on it. nearest_m: from the robot's front to the nearest of
    them along the route.
    """

    def __init__(self, params: PassingParams, max_offset_m: float) -> None:
        self._params = params
        count = math.floor(max_offset_m / _STEP_M + 1e-9)
        self._offsets = _STEP_M * np.arange(-count, count + 1)
        self.reset()

    def reset(self) -> None:
        self.offset_m, self.nearest_m = 0.0, math.inf

    def offsets_m(
        self,
        route: Array,
        people: tuple[Person, ...],
        now_s: float,
        speed_mps: float,
        footprint: Footprint,
        clearance_m: Callable[[float, int], float],
    ) -> Array:
        """(n,) offsets along the route; zero beyond the people who come, and at its end, which is the goal.

        route: (n, 4) x, y, yaw, along from the robot on, odom. clearance_m: of static obstacles with an offset at the
        first of its points, by their number.
        """
        p, along_m = self._params, route[:, 3]
        meets = _meetings(route, people, now_s, speed_mps, footprint, p)
        if len(meets) == 0:
            self.reset()
            return np.zeros(len(route))
        self.nearest_m = float(meets[:, 4].min()) - footprint.front_m
        end_m = min(max(float(meets[:, 0].max()) + footprint.front_m, p.least_m), p.ahead_m)
        # Where people stand, they are obstacles: the robot makes room before them.
        before_m = min([end_m, *(meets[meets[:, 3] > 0.0, 0] - footprint.front_m - _BEFORE_M)])
        count = max(1, int(np.count_nonzero(along_m <= before_m)))
        self.offset_m = self._best(meets, footprint, lambda offset_m: clearance_m(offset_m, count))
        fades = np.minimum(1.0 - (along_m - end_m) / p.fade_m, (along_m[-1] - along_m) / p.fade_m)
        return np.asarray(self.offset_m * np.clip(fades, 0.0, 1.0))

    def _best(self, meets: Array, footprint: Footprint, clearance_m: Callable[[float], float]) -> float:
        p, offsets = self._params, self._offsets
        gaps = np.abs(meets[:, 1] - offsets[:, None]) - meets[:, 2] - 0.5 * footprint.width_m
        # Before people across the whole way, the side at one of its edges leaves the widest lane.
        worth = np.minimum(gaps, p.room_m).mean(axis=1)
        worth -= _BESIDE * np.abs(offsets) + _CHANGE * np.abs(offsets - self.offset_m)
        best = (float(offsets[k]) for k in np.argsort(-worth, kind="stable"))
        return next(one for one in best if one == 0.0 or clearance_m(one) >= p.margin_m)


def beside(poses: Array, offset_m: Array | float) -> Array:
    """(n, 2+) poses of a route, moved to its left."""
    direction, moved = course(poses), poses.copy()
    moved[:, 0] -= offset_m * direction[:, 1]
    moved[:, 1] += offset_m * direction[:, 0]
    return moved


def _meetings(
    route: Array,
    people: tuple[Person, ...],
    now_s: float,
    speed_mps: float,
    footprint: Footprint,
    params: PassingParams,
) -> Array:
    """(m, 5) metres along the route and to the left of it where the robot meets each person who comes; the person's
    radius; 1 for one who stands; metres along the route of where the person is.

    People who have walked and stand on the way will go on along it.
    """
    direction, rows = course(route), []
    for one in people:
        x, y = one.at(now_s)
        k = int(np.argmin(np.hypot(route[:, 0] - x, route[:, 1] - y)))
        tx, ty = direction[k]
        dx, dy = x - route[k, 0], y - route[k, 1]
        along_m, beside_m = float(route[k, 3] + tx * dx + ty * dy), float(tx * dy - ty * dx)
        if not footprint.rear_m < along_m < params.ahead_m or not one.walked:
            continue
        now_m = along_m
        if one.walks:
            if not comes_along(one, direction[k]):
                continue
            closing_mps = max(speed_mps, _SLOWEST_MPS) + math.hypot(one.vx, one.vy)
            time_s = min(max(along_m - footprint.front_m, 0.0) / closing_mps, _DRIFT_S)
            along_m += time_s * (tx * one.vx + ty * one.vy)
            beside_m += time_s * (tx * one.vy - ty * one.vx)
        elif along_m > params.standing_m + footprint.front_m:
            continue
        rows.append((along_m, beside_m, one.radius_m, not one.walks, now_m))
    return np.array(rows).reshape(-1, 5)

"""People as perception finds them in simulated sweeps of a plane: rays, their noise, model of the space, tracker."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from robot_stack.core.compiled import compiled
from robot_stack.core.config import load
from robot_stack.core.geometry import Pose2
from robot_stack.core.people import Person
from robot_stack.core.robot import Robot
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.space.moving_objects import MovingObjects
from robot_stack.perception.space.people import People
from robot_stack.perception.space.space import Space
from robot_stack.perception.space.view import view_of_beams

Array = npt.NDArray[np.float64]
SWEEP_S = 0.1  # a turning LiDAR looks in each direction at 10 Hz
_RAYS, _RANGE_M = 720, 8.0
_ANGLES = 2.0 * math.pi * (np.arange(_RAYS) + 0.5) / _RAYS - math.pi  # in the middles of the view's directions
_RANGE_SIGMA_M = 0.02
# Height of the rays, which show that a place is free, and of all objects.
_RAY_M, _TOP_M = 0.15, 1.7
_LIDAR_X_M = 0.2


class Sweeps:
    """Call ``sweep`` every ``SWEEP_S``, and ``people`` for each costmap."""

    def __init__(self, robot: Robot, random: np.random.Generator) -> None:
        params = load(PerceptionParams, "perception_pipeline")
        self._random = random
        self._space = Space(params.space, robot)
        self._moving = MovingObjects(params.space.moving_objects)
        self._people = People(params.people)

    def sweep(
        self, stamp_s: float, pose: Pose2, occupied: npt.NDArray[np.bool_], resolution_m: float, x_m: float, y_m: float
    ) -> None:
        """One turn around base_link at ``pose``. occupied: (rows, columns) from the corner x_m, y_m on, odom."""
        lidar = pose.compose(Pose2(_LIDAR_X_M, 0.0, 0.0))
        row, column = (lidar.y - y_m) / resolution_m, (lidar.x - x_m) / resolution_m
        away_m = resolution_m * _ranges(occupied, row, column, pose.yaw + _ANGLES, _RANGE_M / resolution_m)
        returned = np.isfinite(away_m)
        away_m = np.where(returned, away_m + self._random.normal(0.0, _RANGE_SIGMA_M, _RAYS), _RANGE_M)
        x, y = _LIDAR_X_M + away_m * np.cos(_ANGLES), away_m * np.sin(_ANGLES)
        ends = np.column_stack((x, y, np.full(_RAYS, _RAY_M))).astype(np.float32)
        own = np.zeros(_RAYS, np.bool_)
        view = view_of_beams(stamp_s, (_LIDAR_X_M, 0.0, _RAY_M), ends, returned, own, _RANGE_M, _RAYS)
        view.hits[:, 2] = _TOP_M
        space = self._space
        space.observe(view, pose)
        for body, vx_mps, vy_mps in self._moving.look(space.appeared(view, pose), stamp_s, space.is_visible):
            if not space.stands_in_view(body, vx_mps, vy_mps):
                space.mark_hidden_body(body, vx_mps, vy_mps, pose)

    def people(self, stamp_s: float) -> tuple[Person, ...]:
        return self._people.look(stamp_s, self._space.grid(), self._moving.bodies(stamp_s))


@compiled
def _ranges(occupied: npt.NDArray[np.bool_], row: float, column: float, angles: Array, reach: float) -> Array:
    """(n,) distance of the first occupied cell from a point at (n,) angles, in cells; infinite without one."""
    out = np.full(len(angles), np.inf)
    for k in range(len(angles)):
        dx, dy = math.cos(angles[k]), math.sin(angles[k])
        distance = 0.0
        while distance < reach:
            r, c = math.floor(row + distance * dy), math.floor(column + distance * dx)
            if r < 0 or c < 0 or r >= occupied.shape[0] or c >= occupied.shape[1]:
                break
            if occupied[r, c]:
                out[k] = distance
                break
            distance += 0.25
    return out

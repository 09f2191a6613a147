"""Publishers of the perception pipeline: obstacles, ends of observed space and of ground, moving objects, grid."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable

import numpy as np
from builtin_interfaces.msg import Time
from nav_msgs.msg import OccupancyGrid

from robot_stack.contract import frames, topics
from robot_stack.core.people import Person, people_points
from robot_stack.core.point_cloud import moving_points, points_from_xyz
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.point_cloud import cloud_message, fill
from robot_stack.perception.pipeline import Scene
from robot_stack.perception.space.space import SpaceGrid

# A grid follows a sweep, not a timer: the sweep whose stamp is nearest to one period after the last grid's.
_SPACE_DUE_S = 1.0 / topics.SPACE.nominal_rate_hz - 0.5 / topics.OBSTACLES.nominal_rate_hz


class PerceptionOutputs:
    """Publishers of the node ``perception_pipeline``. grid: returns the present grid of the space, people: those in it
    at a stamp."""

    def __init__(
        self, node: StackNode, grid: Callable[[], SpaceGrid], people: Callable[[float], tuple[Person, ...]]
    ) -> None:
        self._grid, self._people_at = grid, people
        self._cloud = cloud_message(points_from_xyz(np.empty((0, 3))), frames.BASE_LINK)
        self._ends = cloud_message(points_from_xyz(np.empty((0, 3))), frames.BASE_LINK)
        self._no_ground = cloud_message(points_from_xyz(np.empty((0, 3))), frames.BASE_LINK)
        self._bodies = cloud_message(moving_points(np.empty((0, 5))), frames.BASE_LINK)
        self._moving = node.advertise(topics.MOVING)
        self._obstacles, self._unseen = node.advertise(topics.OBSTACLES), node.advertise(topics.UNSEEN_SPACE)
        self._groundless = node.advertise(topics.NO_GROUND)
        self._space, self._people = node.advertise(topics.SPACE), node.advertise(topics.PEOPLE)
        self._persons = cloud_message(people_points((), 0.0), frames.ODOM)
        self._space_s = -math.inf  # stamp of the last one
        self._repeat = node.create_timer(1.0 / topics.OBSTACLES.nominal_rate_hz, self._send_again)
        self._repeat.cancel()

    def hold_back(self) -> None:
        """A new sweep has arrived: cancels the second publication of the last one."""
        self._repeat.cancel()

    def publish(self, scene: Scene, stamp: Time, *, twice: bool) -> None:
        """twice: again when the next half sweep would be due, because a full sweep takes the time of two."""
        fill(self._cloud, points_from_xyz(scene.obstacles))
        fill(self._ends, points_from_xyz(scene.unseen))
        fill(self._no_ground, points_from_xyz(scene.no_ground))
        fill(self._bodies, moving_points(scene.moving))
        for cloud in (self._cloud, self._ends, self._no_ground, self._bodies):
            cloud.header.stamp = stamp
        self._send()
        if not 0.0 <= scene.stamp_s - self._space_s < _SPACE_DUE_S:
            self._space_s = scene.stamp_s
            fill(self._persons, people_points(self._people_at(scene.stamp_s), scene.stamp_s))
            self._persons.header.stamp = stamp
            self._people.publish(self._persons)
            self._space.publish(_grid_message(self._grid(), stamp))
        if twice:
            self._repeat.reset()

    def _send(self) -> None:
        self._obstacles.publish(self._cloud)
        self._unseen.publish(self._ends)
        self._groundless.publish(self._no_ground)
        self._moving.publish(self._bodies)

    def _send_again(self) -> None:
        self._repeat.cancel()
        self._send()


def _grid_message(space: SpaceGrid, stamp: Time) -> OccupancyGrid:
    grid = OccupancyGrid()
    grid.header.stamp = grid.info.map_load_time = stamp
    grid.header.frame_id = frames.ODOM
    grid.info.resolution = space.cell_m
    grid.info.height, grid.info.width = space.state.shape
    grid.info.origin.position.x, grid.info.origin.position.y = space.corner_m
    grid.info.origin.orientation.w = 1.0
    grid.data = array("b", space.state.tobytes())
    return grid

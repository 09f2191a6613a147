"""costmap_server: /perception/obstacles, /perception/free_space and /odom to /local_costmap/costmap."""

from __future__ import annotations

import time
from array import array

import numpy as np
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import LaserScan, PointCloud2
from std_msgs.msg import Bool

from robot_stack.contract import frames, topics
from robot_stack.core.point_cloud import XYZ, xyz_of
from robot_stack.costmap.costmap import Costs, FreeSpace, LocalCostmap
from robot_stack.costmap.params import CostmapParams
from robot_stack.ros.conversions import pose_from_msg, time_from_s, time_to_s, twist_from_msg
from robot_stack.ros.node import StackNode, run
from robot_stack.ros.point_cloud import points_of

assert topics.LOCAL_COSTMAP.rate_hz is not None
assert topics.OBSTACLES.rate_hz is not None
assert topics.OBSTACLES.stale_s is not None
_OBSTACLES_STALE_S = topics.OBSTACLES.stale_s
_LOOK_HZ = topics.LOCAL_COSTMAP.rate_hz
# A grid follows the cloud that is due, not a timer: the cloud whose stamp is nearest to a period after the last one.
_DUE_S = 1.0 / topics.LOCAL_COSTMAP.rate_hz - 0.5 / topics.OBSTACLES.rate_hz


class CostmapServer(StackNode):
    """Takes in every cloud, and publishes at once with the one that is due."""

    def __init__(self) -> None:
        super().__init__("costmap_server", CostmapParams)
        self._costmap = LocalCostmap(self.params, self.robot)
        self._costmap.warm_up()
        self._published_s = 0.0
        self._problem = ""
        self._message = OccupancyGrid()
        self._message.header.frame_id = frames.ODOM
        self._message.info.origin.orientation.w = 1.0
        self._grid = self.advertise(topics.LOCAL_COSTMAP)
        self._odom = self.subscribe(topics.ODOM, self._on_odometry)
        self._obstacles = self.subscribe(topics.OBSTACLES, self._on_obstacles)
        self.subscribe(topics.FREE_SPACE, self._on_free_space)
        self.subscribe(topics.PASSENGER_ATTACHED, self._on_passenger)
        self._look()
        self.every(_LOOK_HZ, self._look)

    def _on_odometry(self, message: Odometry) -> None:
        pose, twist = pose_from_msg(message.pose.pose), twist_from_msg(message.twist.twist)
        self._complain(self._costmap.on_odometry(time_to_s(message.header.stamp), pose, twist))

    def _on_passenger(self, message: Bool) -> None:
        self._costmap.chair = message.data

    def _on_free_space(self, message: LaserScan) -> None:
        ranges_m = np.asarray(message.ranges, np.float32)
        free = FreeSpace(ranges_m, message.angle_min, message.angle_increment, time_to_s(message.header.stamp))
        self._complain(self._costmap.on_free_space(free))

    def _on_obstacles(self, message: PointCloud2) -> None:
        begin_s = time.process_time()
        self._problem = self._take(message)
        if self._problem:
            self._complain(self._problem)
            return
        stamp_s = time_to_s(message.header.stamp)
        if not 0.0 <= stamp_s - self._published_s < _DUE_S:
            self._publish(self._costmap.costs())
            self._published_s = stamp_s
        self.report.values["update"] = f"{1e3 * (time.process_time() - begin_s):.1f} ms"

    def _take(self, message: PointCloud2) -> str:
        """Returns why the cloud cannot be used, empty if it can."""
        if message.header.frame_id != frames.BASE_LINK:
            return f"obstacles refused: frame_id is {message.header.frame_id!r}, must be {frames.BASE_LINK!r}"
        age_s = self.now_s() - time_to_s(message.header.stamp)
        if not age_s <= _OBSTACLES_STALE_S:
            return f"obstacles refused: they are {age_s:.2f} s old"
        if not self._odom.fresh():
            return "no fresh /odom"
        try:
            points = points_of(message, XYZ)
        except ValueError as error:
            return f"obstacles refused: {error}"
        packed = points if points.dtype == XYZ else points.astype(XYZ)
        return self._costmap.on_obstacles(time_to_s(message.header.stamp), xyz_of(packed))

    def _publish(self, costs: Costs) -> None:
        message = self._message
        message.header.stamp = time_from_s(costs.stamp_s)
        message.info.map_load_time = message.header.stamp
        message.info.resolution = costs.resolution_m
        message.info.height, message.info.width = costs.values.shape
        message.info.origin.position.x, message.info.origin.position.y = costs.corner_m
        message.data = array("b", costs.values.tobytes())
        self._grid.publish(message)

    def _look(self) -> None:
        """Says why nothing is published."""
        silent = [entry.topic.name for entry in (self._odom, self._obstacles) if not entry.fresh()]
        if silent:
            self.set_health(False, f"waiting for {', '.join(silent)}")
        else:
            self.set_health(not self._problem, self._problem or "mapping")

    def _complain(self, problem: str) -> None:
        if problem:
            self.get_logger().error(problem, throttle_duration_sec=1.0)


def main() -> None:
    run(CostmapServer)


if __name__ == "__main__":
    main()

"""Node overhead_lidar_adapter: the frames of another vendor's ROS driver as /sensors/overhead_lidar/points."""

from __future__ import annotations

from robot_stack.contract import frames, topics
from robot_stack.drivers.nodes.vendor_cloud import VendorCloudNode
from robot_stack.drivers.point_cloud.params import PointCloudAdapterParams


class OverheadLidarAdapterNode(VendorCloudNode):
    sensor, vendor, points = frames.OVERHEAD_LIDAR, topics.OVERHEAD_VENDOR_POINTS, topics.OVERHEAD_LIDAR_POINTS

    def __init__(self) -> None:
        super().__init__("overhead_lidar_adapter", PointCloudAdapterParams)

"""Node point_cloud_adapter: the sweeps of another vendor's ROS driver as /sensors/lidar/points."""

from __future__ import annotations

from robot_stack.contract import frames, topics
from robot_stack.drivers.nodes.vendor_cloud import VendorCloudNode
from robot_stack.drivers.point_cloud.params import PointCloudAdapterParams


class PointCloudAdapterNode(VendorCloudNode):
    sensor, vendor, points = frames.LIDAR, topics.VENDOR_POINTS, topics.LIDAR_POINTS

    def __init__(self) -> None:
        super().__init__("point_cloud_adapter", PointCloudAdapterParams)

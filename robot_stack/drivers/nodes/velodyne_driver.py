"""Node velodyne_driver: the packets of a VLP-16 as /sensors/lidar/points."""

from __future__ import annotations

from robot_stack.contract import frames
from robot_stack.core.range_sensor import RangeSensor
from robot_stack.drivers.nodes.packet_lidar import PacketLidarNode
from robot_stack.drivers.velodyne.params import VelodyneDriverParams
from robot_stack.drivers.velodyne.sweeps import SweepBuilder


class VelodyneDriverNode(PacketLidarNode):
    vendor = "Velodyne"

    def __init__(self) -> None:
        super().__init__("velodyne_driver", VelodyneDriverParams)

    def builder(self, sensor: RangeSensor) -> SweepBuilder:
        return SweepBuilder(self.params, sensor.period_s, self.robot.to_sensor_frame(frames.LIDAR))

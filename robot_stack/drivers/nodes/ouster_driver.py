"""Node ouster_driver: the packets of an Ouster OS sensor as /sensors/lidar/points."""

from __future__ import annotations

from robot_stack.contract import frames
from robot_stack.core.range_sensor import RangeSensor
from robot_stack.drivers.nodes.ouster_metadata import check, load_metadata
from robot_stack.drivers.nodes.packet_lidar import PacketLidarNode
from robot_stack.drivers.ouster.params import OusterDriverParams
from robot_stack.drivers.ouster.sweeps import SweepBuilder
from robot_stack.drivers.ouster.warm_up import warm_up


class OusterDriverNode(PacketLidarNode):
    vendor = "Ouster"

    def __init__(self) -> None:
        super().__init__("ouster_driver", OusterDriverParams)

    def builder(self, sensor: RangeSensor) -> SweepBuilder:
        metadata, source = load_metadata(self.params)
        check(metadata, source, sensor)
        warm_up()
        return SweepBuilder(self.params, metadata, source, self.robot.to_sensor_frame(frames.LIDAR))

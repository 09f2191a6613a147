"""Parameters of the node velodyne_driver: ``config/velodyne_driver.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.drivers.packet_lidar_params import PacketLidarParams


class VelodyneDriverParams(PacketLidarParams):
    """A packet's time is that of its first firing."""

    max_range_m: Annotated[float, Field(ge=10.0, le=200.0)]

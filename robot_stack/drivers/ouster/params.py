"""Parameters of the node ouster_driver: ``config/ouster_driver.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.drivers.packet_lidar_params import PacketLidarParams


class OusterDriverParams(PacketLidarParams):
    """A packet's time is that of its last column.

    metadata_file: the sensor's metadata, in the folder of this configuration.
    """

    metadata_file: Annotated[str, Field(min_length=1)]

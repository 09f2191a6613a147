"""Parameters of the adapters: ``config/point_cloud_adapter.yaml``, ``config/overhead_lidar_adapter.yaml``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from robot_stack.core.config import Config

Degrees = Annotated[float, Field(ge=-180.0, le=180.0)]


class PointCloudAdapterParams(Config):
    """topic, frame_id: as the vendor's driver publishes; points in another frame are refused.

    rpy_deg: the vendor's frame in the sensor's own axes, turned about the fixed x, y, z; how that is
    mounted is in ``config/robot.yaml``.
    silence_s: timeout of the vendor driver's clouds.
    """

    topic: Annotated[str, Field(pattern=r"^(/[A-Za-z][A-Za-z0-9_]*)+$")]
    frame_id: Annotated[str, Field(min_length=1)]
    layout: Literal["auto", "ouster", "velodyne", "hesai", "livox", "robosense", "nebula"]
    stamp_at: Literal["auto", "first", "last", "trigger"]
    rpy_deg: tuple[Degrees, Degrees, Degrees]
    stamp_tolerance_s: Annotated[float, Field(gt=0.0, le=0.05)]
    future_s: Annotated[float, Field(gt=0.0, le=0.1)]
    oldest_s: Annotated[float, Field(gt=0.0, le=1.0)]
    silence_s: Annotated[float, Field(gt=0.0, le=5.0)]

"""Shared parameters of the drivers of LiDARs that send packets by UDP."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, IPvAnyAddress

from robot_stack.core.config import Config
from robot_stack.drivers.device_clock import DeviceClockParams

Degrees = Annotated[float, Field(ge=-180.0, le=180.0)]


class PacketLidarParams(Config):
    """bind_address, port: of the socket. device_ip: the only accepted sender.

    rpy_deg: rotation of the LiDAR's data in its own axes, about the fixed ones; its mounting is in
    ``config/robot.yaml``.
    latency_s: least time from a packet's stamp to its arrival. silence_s: timeout of sweeps.
    """

    bind_address: IPvAnyAddress
    port: Annotated[int, Field(ge=1024, le=65535)]
    device_ip: IPvAnyAddress
    rpy_deg: tuple[Degrees, Degrees, Degrees]
    min_range_m: Annotated[float, Field(ge=0.1, le=5.0)]
    max_range_m: Annotated[float, Field(ge=10.0, le=500.0)]
    latency_s: Annotated[float, Field(ge=0.0, le=0.05)]
    clock: DeviceClockParams
    silence_s: Annotated[float, Field(gt=0.0, le=5.0)]

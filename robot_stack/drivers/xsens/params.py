"""Parameters of the node xsens_driver: ``config/xsens_driver.yaml``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from robot_stack.drivers.device_clock import DeviceClockParams
from robot_stack.drivers.imu import ImuParams
from robot_stack.drivers.serial_params import SerialParams


class XsensDriverParams(ImuParams):
    """latency_s: from a sample to its last byte's arrival, at best. silence_s: without a sample: called silent."""

    serial: SerialParams
    baud_rate: Literal[9600, 115200, 230400, 460800, 921600, 2000000]
    latency_s: Annotated[float, Field(ge=0.0, le=0.05)]
    clock: DeviceClockParams
    silence_s: Annotated[float, Field(gt=0.0, le=1.0)]

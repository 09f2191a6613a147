"""Parameters of the node xsens_driver: ``config/xsens_driver.yaml``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from robot_stack.core.config import Config
from robot_stack.drivers.device_clock import DeviceClockParams
from robot_stack.drivers.serial_params import SerialParams

Sigma = Annotated[float, Field(gt=0.0, le=10.0)]
Degrees = Annotated[float, Field(ge=-180.0, le=180.0)]


class XsensDriverParams(Config):
    """rpy_deg: the unit in base_link, turned about its fixed axes x, y, z. latency_s: from a sample to its last byte's

    arrival, at best. sigmas: standard deviations of the data sheet. silence_s: without a sample: called silent.
    """

    serial: SerialParams
    baud_rate: Literal[9600, 115200, 230400, 460800, 921600, 2000000]
    rpy_deg: tuple[Degrees, Degrees, Degrees]
    latency_s: Annotated[float, Field(ge=0.0, le=0.05)]
    clock: DeviceClockParams
    acceleration_sigma_mps2: Sigma
    rotation_sigma_radps: Sigma
    attitude_sigma_rad: Sigma
    heading_sigma_rad: Sigma
    silence_s: Annotated[float, Field(gt=0.0, le=1.0)]

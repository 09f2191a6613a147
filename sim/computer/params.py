"""Parameters of the simulated computer, ``config/sim_computer.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config

Percent = Annotated[float, Field(ge=0.0, le=100.0)]


class SimComputerParams(Config):
    """folder: of its files, in the runtime folder, as in the parameters of system_monitor.

    tick_rate_hz: how often the kernel's counters go on. cpu_percent, memory_percent, celsius: without a fault.
    disk_bytes: size of the small file system that stands for a full disk. page_period_s: of a page's heartbeat.
    """

    folder: Annotated[str, Field(pattern=r"^[a-z0-9_]+$")]
    tick_rate_hz: Annotated[float, Field(ge=20.0, le=100.0)]
    cpu_percent: Percent
    memory_percent: Percent
    celsius: Annotated[float, Field(ge=-40.0, le=120.0)]
    disk_bytes: Annotated[int, Field(ge=2**16, le=2**24)]
    page_period_s: Annotated[float, Field(gt=0.0, le=2.0)]

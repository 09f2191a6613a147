"""Parameters of the simulated display, ``config/ehmi_display.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config


class FirmwareParams(Config):
    """boot_s: from power to READY. latency_s, latency_jitter_s: of an answer, uniform. noise: share of bytes that
    arrive changed. host_timeout_s: without a state for this time the display shows an error by itself.
    fault_repeat_s: between two lines about a fault. seed: of the noise.
    """

    boot_s: Annotated[float, Field(ge=0.0, le=30.0)]
    latency_s: Annotated[float, Field(ge=0.0, le=1.0)]
    latency_jitter_s: Annotated[float, Field(ge=0.0, le=1.0)]
    noise: Annotated[float, Field(ge=0.0, le=1.0)]
    host_timeout_s: Annotated[float, Field(gt=0.0, le=60.0)]
    fault_repeat_s: Annotated[float, Field(gt=0.0, le=60.0)]
    seed: Annotated[int, Field(ge=0)]


class EhmiDisplayParams(Config):
    """link_name: of the terminal, in the runtime folder, as in the bridge's parameter ``port``."""

    link_name: Annotated[str, Field(pattern=r"^[a-z0-9_]+$")]
    tick_rate_hz: Annotated[float, Field(ge=1.0, le=50.0)]
    firmware: FirmwareParams

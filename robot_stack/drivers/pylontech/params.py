"""Parameters of the node pylontech_driver: ``config/pylontech_driver.yaml``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from robot_stack.core.config import Config
from robot_stack.drivers.battery import PackParams


class CanParams(Config):
    """interface: of python-can. channel: a network interface, or for slcan a device; relative: in the runtime folder.

    reopen_s: pause after a failed open. silent_s: silence after which it is closed and reopened.
    keep_alive_s: period of keep-alive frames; null: never.
    """

    interface: Literal["socketcan", "slcan"]
    channel: Annotated[str, Field(min_length=1)]
    bitrate: Literal[125000, 250000, 500000, 1000000]
    reopen_s: Annotated[float, Field(gt=0.0, le=10.0)]
    silent_s: Annotated[float, Field(gt=0.0, le=60.0)]
    keep_alive_s: Annotated[float, Field(ge=0.1, le=60.0)] | None


class PylontechDriverParams(Config):
    can: CanParams
    pack: PackParams

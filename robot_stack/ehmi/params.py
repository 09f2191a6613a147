"""Parameters of the node ehmi_bridge, ``config/ehmi_bridge.yaml``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from robot_stack.core.config import Config

Seconds = Annotated[float, Field(gt=0.0, le=60.0)]


class LinkParams(Config):
    """Times of the line.

    acknowledge_s: timeout of an answer; tries: number of times a command is sent before the link counts as lost.
    repeat_s: period of repeating the state. probe_s: period of PINGs to a display that does not answer.
    reopen_s: silence after which the port is closed and reopened. back_off_s: first pause after a failed open;
    it doubles up to back_off_limit_s.
    """

    acknowledge_s: Annotated[float, Field(gt=0.0, le=2.0)]
    tries: Annotated[int, Field(ge=1, le=10)]
    repeat_s: Seconds
    probe_s: Seconds
    reopen_s: Seconds
    back_off_s: Seconds
    back_off_limit_s: Seconds
    checksum: bool


class EhmiParams(Config):
    """port: a device; a relative name lies in the runtime folder. language, volume: until others are requested."""

    port: Annotated[str, Field(min_length=1)]
    baud_rate: Literal[9600, 19200, 38400, 57600, 115200, 230400]
    tick_rate_hz: Annotated[float, Field(ge=2.0, le=50.0)]
    language: Literal["en", "ja", "zh"]
    volume: Annotated[int, Field(ge=0, le=10)]
    safety_silence_s: Seconds
    link: LinkParams

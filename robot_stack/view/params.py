"""Parameters of the live view, ``config/view.yaml``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from robot_stack.core.config import Config


class DisplayParams(Config):
    """The external display above the robot. language: of its text. unknown: text without an answer of the display."""

    width_m: Annotated[float, Field(ge=0.1, le=5.0)]
    bottom_m: Annotated[float, Field(ge=0.0, le=5.0)]
    language: Literal["en", "ja", "zh"]
    unknown: Annotated[str, Field(min_length=1, max_length=40)]


class ViewParams(Config):
    host: Literal["127.0.0.1", "::1", "localhost"]
    port: Annotated[int, Field(ge=0, le=65535)]
    take_hz: Annotated[float, Field(ge=1.0, le=100.0)]
    model_hz: Annotated[float, Field(ge=1.0, le=50.0)]
    backlog_messages: Annotated[int, Field(ge=16, le=4096)]
    display: DisplayParams

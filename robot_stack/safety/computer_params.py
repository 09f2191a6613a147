"""When the robot's computer is in trouble, and which screen is missed. The links' time-outs are their topics'."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config

Positive = Annotated[float, Field(gt=0.0)]
Percent = Annotated[float, Field(gt=0.0, le=100.0)]


class ComputerParams(Config):
    """Every comparison is strict; 100 % is so never exceeded.

    cpu_high_s: for so long without a break. *_hysteresis_*: a row that was raised is gone only so far below its limit.
    """

    overheat_c: Positive
    overheat_hysteresis_c: Positive
    cpu_high_percent: Percent
    cpu_high_s: Positive
    memory_high_percent: Percent
    disk_full_percent: Percent
    usage_hysteresis_percent: Positive


class LinkParams(Config):
    """ui_required: a page must be connected from the start; else one is missed only after it has been connected."""

    ui_required: bool

"""Limits of the robot's computer, and the required screen. The links' timeouts are those of their topics."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config, Positive

Percent = Annotated[float, Field(gt=0.0, le=100.0)]


class ComputerParams(Config):
    """Every comparison is strict, so that 100 % is never exceeded.

    cpu_high_s: duration without a break. *_hysteresis_*: a raised row clears only this far below its limit.
    """

    overheat_c: Positive
    overheat_hysteresis_c: Positive
    cpu_high_percent: Percent
    cpu_high_s: Positive
    memory_high_percent: Percent
    disk_full_percent: Percent
    usage_hysteresis_percent: Positive


class LinkParams(Config):
    """ui_required: a page must be connected from the start; else only after it has once been connected."""

    ui_required: bool

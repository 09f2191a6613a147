"""Switches of drives without physics: derived from the drive's position."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from robot_stack.wmx.bus import DriveFeedback
from robot_stack.wmx.config import EngineConfig

ALWAYS_OFF: Final = math.inf


@dataclass(slots=True)
class DriveSwitches:
    """Sensors of one drive, in its encoder counts.

    The positive limit switch is on from ``positive_limit`` upwards, the negative one from ``negative_limit`` downwards,
    the home switch from ``home_from`` to ``home_to``.
    """

    positive_limit: float = ALWAYS_OFF
    negative_limit: float = -ALWAYS_OFF
    home_from: float = ALWAYS_OFF
    home_to: float = ALWAYS_OFF

    def fill(self, inp: DriveFeedback, axis: int, position: float) -> None:
        """Sets the sensors' states at ``position``."""
        inp.has_limit_switches[axis] = self.positive_limit != ALWAYS_OFF or self.negative_limit != -ALWAYS_OFF
        inp.has_home_switch[axis] = self.home_from != ALWAYS_OFF
        inp.positive_limit[axis] = position >= self.positive_limit
        inp.negative_limit[axis] = position <= self.negative_limit
        inp.home_switch[axis] = self.home_from <= position <= self.home_to


def drive_switches(config: EngineConfig) -> list[DriveSwitches | None]:
    """The switches that a configuration gives its drives; None for a drive without any."""
    return [_of_axis(config, axis) for axis in range(config.n_axes)]


def _of_axis(config: EngineConfig, axis: int) -> DriveSwitches | None:
    kind = config.axis_kind(axis)
    if kind.switches is None:
        return None
    scale, where = abs(kind.counts_per_rad), kind.switches

    def counts(position_rad: float | None, absent: float) -> float:
        return absent if position_rad is None else scale * position_rad

    return DriveSwitches(
        positive_limit=counts(where.positive_limit_rad, ALWAYS_OFF),
        negative_limit=counts(where.negative_limit_rad, -ALWAYS_OFF),
        home_from=counts(where.home_from_rad, ALWAYS_OFF),
        home_to=counts(where.home_to_rad, ALWAYS_OFF),
    )

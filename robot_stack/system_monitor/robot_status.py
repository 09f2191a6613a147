"""The summary of the robot: every field from its source, unknown where the source is silent."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from robot_stack.contract.model import SafetyState
from robot_stack.contract.states import ACTIVE

# Names in /robot_status for the states of /safety/status; it has no COLLISION_AVOIDANCE.
_SHOWN = {state.name: state.name for state in SafetyState} | {
    SafetyState.COLLISION_AVOIDANCE.name: SafetyState.DEGRADED.name
}


@dataclass(frozen=True, slots=True)
class Battery:
    """V, share of the charge [0, 1], A (negative = discharging); NaN = unknown."""

    voltage_v: float = math.nan
    charge: float = math.nan
    current_a: float = math.nan

    @property
    def percent(self) -> float:
        return 100.0 * self.charge if 0.0 <= self.charge <= 1.0 else math.nan


@dataclass(frozen=True, slots=True)
class Safety:
    """state: of /safety/status, empty = unknown."""

    state: str = ""
    faults: tuple[str, ...] = ()

    @property
    def shown(self) -> str:
        """The state's name in /robot_status; empty for an unknown one."""
        return _SHOWN.get(self.state, "")


@dataclass(frozen=True, slots=True)
class Mission:
    """The current mission; everything empty without one."""

    mission_id: str = ""
    waypoint: str = ""
    completed: int = 0
    total: int = 0


def current_mission(state: str, mission: Mission) -> Mission:
    """``mission`` while /mission/status shows ``state`` of an active mission, else none."""
    return mission if state in ACTIVE else Mission()


@dataclass(frozen=True, slots=True)
class Usage:
    """% of all processors, of the memory, of the disk; NaN = unknown."""

    cpu_percent: float = math.nan
    memory_percent: float = math.nan
    disk_percent: float = math.nan


@dataclass(frozen=True, slots=True)
class Summary:
    """quality: of the localization [0, 1], NaN = unknown."""

    battery: Battery = field(default_factory=Battery)
    quality: float = math.nan
    safety: Safety = field(default_factory=Safety)
    mission: Mission = field(default_factory=Mission)
    usage: Usage = field(default_factory=Usage)

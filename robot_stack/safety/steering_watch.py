"""Checks the modules' headings against their commands, and the wheels for one common motion (fault STEERING_FAULT).

A module with stuck steering drags the robot off its course and falsifies the odometry, while neither of its two axes
has an alarm. A standing robot first turns its modules by any angle: only a rolling one is judged.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from robot_stack.contract.frames import MODULES
from robot_stack.contract.model import SafetyAction
from robot_stack.core.geometry import wrap_angle
from robot_stack.safety.dead_reckoning import Modules
from robot_stack.safety.inputs import CLEAR, Finding, Level
from robot_stack.safety.params import SteeringParams
from robot_stack.safety.timing import Hold, age_s


class SteeringWatch:
    """Tracks commanded and measured headings. Steady seconds. stale_s: an older command does not count."""

    def __init__(self, params: SteeringParams, modules: Modules, standstill_mps: float, stale_s: float) -> None:
        self._params, self._modules = params, modules
        self._standstill_mps, self._stale_s = standstill_mps, stale_s
        self._commanded_rad: tuple[float, ...] = ()
        self._commanded_s: float | None = None
        self._speeds_mps: tuple[float, ...] = ()
        self._angles_rad: tuple[float, ...] = ()
        self._off_for = [Hold() for _ in MODULES]
        self._contradict_for = Hold()

    def commanded(self, angles_rad: Sequence[float], now_s: float) -> None:
        """Headings in the order of the modules. Incomplete or non-finite ones count as not received."""
        if len(angles_rad) == len(MODULES) and all(map(math.isfinite, angles_rad)):
            self._commanded_rad, self._commanded_s = tuple(angles_rad), now_s

    def measured(self, speeds_mps: Sequence[float], angles_rad: Sequence[float]) -> None:
        """Speeds of the wheels and headings of the modules, not wrapped."""
        self._speeds_mps, self._angles_rad = tuple(speeds_mps), tuple(angles_rad)

    def judge(self, now_s: float) -> Finding:
        """Call once per step. While joint states are missing, JOINT_STATES_TIMEOUT stops the robot."""
        rolls = any(abs(speed) >= self._standstill_mps for speed in self._speeds_mps)
        known = rolls and age_s(now_s, self._commanded_s) <= self._stale_s
        off_rad = [0.0] * len(MODULES)
        if known:
            off_rad = [wrap_angle(a - b) for a, b in zip(self._commanded_rad, self._angles_rad, strict=True)]
        wrong = [
            f"{name}_steer is {math.degrees(off):.0f} deg off"
            for name, off, hold in zip(MODULES, off_rad, self._off_for, strict=True)
            if self._too_long(hold, abs(off) > self._params.angle_rad, now_s)
        ]
        apart_mps = self._modules.disagreement_mps(self._speeds_mps, self._angles_rad) if rolls else 0.0
        if self._too_long(self._contradict_for, apart_mps > self._params.disagreement_mps, now_s):
            wrong.append(f"a wheel differs by {apart_mps:.2f} m/s from the motion of all")
        return Finding(Level.PRESENT, SafetyAction.EMERGENCY_STOP, detail=", ".join(wrong)) if wrong else CLEAR

    def _too_long(self, hold: Hold, condition: bool, now_s: float) -> bool:
        for_s = hold.update(condition, now_s)
        return for_s is not None and for_s > self._params.hold_s

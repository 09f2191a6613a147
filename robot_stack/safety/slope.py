"""Limits of the slope: slow above one threshold, above a second one only downhill along the fall line.

A robot that may not move at all on a steep slope would have to be carried off it. Downhill it can leave by itself:
gravity helps, and straight down the fall line it cannot tip over its side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from robot_stack.contract.model import SafetyAction
from robot_stack.core.geometry import Twist2, wrap_angle
from robot_stack.core.limits import STANDSTILL, SpeedLimit
from robot_stack.safety.inputs import CLEAR, UNKNOWN, Finding, Level
from robot_stack.safety.timing import age_s

if TYPE_CHECKING:
    from robot_stack.safety.params import SafetyParams

Points = tuple[tuple[float, float], ...]


class SlopeWatch:
    """Judges the inclination, and on a steep slope every requested motion. Steady seconds.

    modules_m: (x, y) of the wheels in base_link, m.
    """

    def __init__(self, params: SafetyParams, modules_m: Points) -> None:
        self._params = params
        self._modules_m = modules_m
        self._limited = self._steep = self._descends = False
        self._refused_s: float | None = None

    def judge(self, inclination_rad: float, downhill_rad: float, motions: Sequence[Twist2], now_s: float) -> Finding:
        """Call once per step.

        Args:
            inclination_rad: between base_link's z axis and the vertical, NaN while unknown.
            downhill_rad: bearing of the fall line in base_link, down.
            motions: the requested one and the drive's own command, without standstills; base_link.
        """
        if math.isnan(inclination_rad):
            # The fall line is unknown. A slope that was not steep is UNKNOWN and keeps its limit.
            return _present("the fall line is unknown on a steep slope") if self._steep else UNKNOWN
        p = self._params
        self._limited = inclination_rad > math.radians(
            p.slope_limit_deg - (p.slope_hysteresis_deg if self._limited else 0.0)
        )
        self._steep = inclination_rad > math.radians(
            p.slope_stop_deg + p.slope_tolerance_deg + (0.0 if self._steep else p.slope_hysteresis_deg)
        )
        detail = f"inclination {math.degrees(inclination_rad):.1f} deg"
        if self._steep:
            return self._descent(detail, downhill_rad, motions, now_s)
        limit = SpeedLimit(p.slope_limit_mps, p.slope_limit_radps)
        return _present(detail, limit) if self._limited else CLEAR

    def _descent(self, detail: str, downhill_rad: float, motions: Sequence[Twist2], now_s: float) -> Finding:
        p = self._params.descent
        limit = SpeedLimit(p.max_speed_mps, p.max_yaw_rate_radps)
        if not motions:
            # A planner needs a limit above zero to begin. After a refusal it has to wait for one: otherwise an uphill
            # goal would be tried again at every step.
            self._descends = False
            if age_s(now_s, self._refused_s) >= p.ask_again_s:
                return _present(f"{detail}, only downhill", limit)
            return _present(f"{detail}, refused a motion that was not downhill")
        allowed_rad = math.radians(p.angle_deg + (p.angle_hysteresis_deg if self._descends else 0.0))
        self._descends = all(self._leads_down(motion, downhill_rad, allowed_rad) for motion in motions)
        if self._descends:
            return _present(f"{detail}, downhill", limit)
        self._refused_s = now_s
        return _present(f"{detail}, the motion is not downhill")

    def _leads_down(self, motion: Twist2, downhill_rad: float, allowed_rad: float) -> bool:
        """True if the course follows the fall line and no wheel rolls uphill: a turn on the spot is no descent."""
        off_rad = abs(wrap_angle(math.atan2(motion.vy, motion.vx) - downhill_rad))
        down_x, down_y = math.cos(downhill_rad), math.sin(downhill_rad)
        wheels_mps = (
            (motion.vx - motion.omega * y) * down_x + (motion.vy + motion.omega * x) * down_y
            for x, y in self._modules_m
        )
        return off_rad <= allowed_rad and min(wheels_mps) >= 0.0


def _present(detail: str, limit: SpeedLimit = STANDSTILL) -> Finding:
    if limit == STANDSTILL:
        return Finding(Level.PRESENT, SafetyAction.STOP, detail=detail)
    return Finding(Level.PRESENT, SafetyAction.LIMIT, limit, detail)

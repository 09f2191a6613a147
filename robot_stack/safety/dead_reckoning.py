"""The robot's motion by its wheels: their common twist, and the pose integrated from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2, exp_se2
from robot_stack.core.rigid_motion import residuals, rigid_fit


@dataclass(frozen=True, slots=True)
class Modules:
    """The drive's geometry, m: (x, y) of the steering axes in base_link."""

    positions_m: tuple[tuple[float, float], ...]
    wheel_radius_m: float

    def twist(self, speeds_mps: Sequence[float], angles_rad: Sequence[float]) -> Twist2:
        """The least-squares twist of base_link for the modules' velocities."""
        return rigid_fit(self.positions_m, _velocities(speeds_mps, angles_rad))

    def disagreement_mps(self, speeds_mps: Sequence[float], angles_rad: Sequence[float]) -> float:
        """Largest deviation of a module's velocity from that of the least-squares twist, m/s."""
        velocities = _velocities(speeds_mps, angles_rad)
        return max(residuals(self.positions_m, velocities, rigid_fit(self.positions_m, velocities)))


def _velocities(speeds_mps: Sequence[float], angles_rad: Sequence[float]) -> list[tuple[float, float]]:
    """(x, y) of the wheels' rims, m/s, base_link."""
    wheels = zip(speeds_mps, angles_rad, strict=True)
    return [(speed * math.cos(angle), speed * math.sin(angle)) for speed, angle in wheels]


class DeadReckoning:
    """base_link in a frame that begins at the robot's first pose. Steady seconds."""

    def __init__(self, max_gap_s: float) -> None:
        self._max_gap_s = max_gap_s
        self._at_s = math.nan
        self.pose = IDENTITY
        self.twist = ZERO_TWIST

    def update(self, twist: Twist2, now_s: float) -> None:
        """A measured twist, base_link. Over a gap nothing is added: the motion is unknown."""
        dt_s = now_s - self._at_s
        if 0.0 <= dt_s <= self._max_gap_s:
            self.pose = self.pose.compose(exp_se2(twist, dt_s))
        self.twist, self._at_s = twist, now_s

    def pose_at(self, moment_s: float) -> Pose2:
        """base_link a moment ago or ahead, by the newest twist; the newest pose beyond the longest gap."""
        ahead_s = moment_s - self._at_s
        if not abs(ahead_s) <= self._max_gap_s:
            return self.pose
        return self.pose.compose(exp_se2(self.twist, ahead_s))

"""Detection of contact: pushing takes more force of the wheels than rolling."""

from __future__ import annotations

import math
from collections.abc import Iterable

from robot_stack.docking.params import ContactParams


def push_n(torques_nm: Iterable[float], headings_rad: Iterable[float], wheel_radius_m: float) -> float:
    """Force of the wheels along base_link's x, N: each by the torque of its drive and the heading of its module."""
    pairs = zip(torques_nm, headings_rad, strict=True)
    return sum(torque * math.cos(heading) for torque, heading in pairs) / wheel_radius_m


class ContactWatch:
    """Compares the wheels' force along the approach with that of free rolling just before.

    Free rolling includes the slope and the drives' friction, so that only the force of the dock remains.
    """

    def __init__(self, params: ContactParams) -> None:
        self._params = params
        self.reset()

    def reset(self) -> None:
        self._force_n = math.nan
        self._free_n = math.nan
        self._moving_s = 0.0

    @property
    def excess_n(self) -> float:
        """Force above free rolling, 0 while that is not known."""
        excess = self._force_n - self._free_n
        return excess if math.isfinite(excess) else 0.0

    def update(self, force_n: float, distance_m: float, moving_in: bool, dt_s: float) -> bool:
        """Adds the wheels' force along the approach, N. Returns True on contact.

        distance_m: before the dock pose. moving_in: the robot is commanded towards it.
        """
        p = self._params
        if not math.isfinite(force_n) or not dt_s > 0.0:
            return False
        keep = math.exp(-dt_s / p.time_constant_s)
        self._force_n = force_n if math.isnan(self._force_n) else keep * self._force_n + (1.0 - keep) * force_n
        self._moving_s = self._moving_s + dt_s if moving_in else 0.0
        if self._moving_s < p.settle_s:  # starting costs effort of its own
            return False
        if distance_m > p.watch_below_m or math.isnan(self._free_n):
            slow = math.exp(-dt_s / (5.0 * p.time_constant_s))
            free = self._force_n if math.isnan(self._free_n) else self._free_n
            self._free_n = slow * free + (1.0 - slow) * self._force_n
            return False
        return self.excess_n > p.force_n

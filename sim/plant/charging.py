"""The charging contacts in front of the world's stations."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robot_stack.core.geometry import Pose2
from sim.worldfile import WorldFile


class ChargingContacts:
    """dead: no station gives power."""

    def __init__(self, world: WorldFile) -> None:
        self._places: Sequence[tuple[Pose2, float, float, float]] = [
            (
                # The robot stands with its rear to the board.
                world.stations[name].pose().compose(Pose2(charger.base_x_m, 0.0, math.pi)),
                charger.tolerance_m,
                math.radians(charger.tolerance_deg),
                charger.power_w,
            )
            for name, charger in world.chargers.items()
        ]
        self.dead = False

    def power_w(self, robot: Pose2) -> float:
        """Power into a robot whose base_link is at ``robot`` in map; 0 away from all contacts."""
        if self.dead:
            return 0.0
        for place, tolerance_m, tolerance_rad, power_w in self._places:
            off = robot.relative_to(place)
            if math.hypot(off.x, off.y) <= tolerance_m and abs(off.yaw) <= tolerance_rad:
                return power_w
        return 0.0

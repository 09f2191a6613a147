"""Contacts of robot and wheelchair in one physics model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.plant.mjcf import CHAIR_GROUP, ROBOT_GROUP
from sim.plant.surface import Area
from sim.plant.terrain import solids
from sim.worldfile import WorldFile

ROBOT, CHAIR = 1, 2


def parts(model: Any) -> NDArray[np.int8]:
    """(bodies,) number of robot or chair by body; 0: neither."""
    part = np.zeros(model.nbody, np.int8)
    part[model.geom_bodyid[model.geom_group == ROBOT_GROUP]] = ROBOT
    part[model.geom_bodyid[model.geom_group == CHAIR_GROUP]] = CHAIR
    return part


class Contacts:
    """Names of touched objects except ground and ramps."""

    def __init__(self, model: Any, world: WorldFile, wheels: Sequence[int]) -> None:
        self._names = [model.geom(index).name for index in range(model.ngeom)]
        machine = parts(model)[model.geom_bodyid] > 0
        allowed = {"ground", *(solid.name for solid in solids(world) if solid.kind == "ramp")}
        self._machine = machine
        self._harmless = machine | np.array([name in allowed for name in self._names])
        self._wheels = list(wheels)
        self._pits = [
            (pit.name, Area(pit.x_m, pit.y_m, pit.yaw_rad, 0.5 * pit.length_m, 0.5 * pit.width_m, 1.0))
            for pit in world.pits
        ]
        self.first_s: dict[str, float] = {}
        self._seen = b""

    def now(self, data: Any) -> tuple[str, ...]:
        """In alphabetical order, each once."""
        pairs = data.contact.geom
        odd = self._machine[pairs] | ~self._harmless[pairs]
        found = {
            self._names[geom]
            for pair in pairs[odd.all(axis=1)]
            for geom in pair
            if not self._harmless[geom] and self._machine[pair].any()
        }
        return tuple(sorted(found.union(self._pits_under_wheels(data))))

    def note(self, data: Any, time_s: float) -> None:
        """Adds the present contacts to ``first_s``."""
        # The wheels' contacts seldom change: only a pit, which has no contacts, can be new.
        pairs = data.contact.geom.tobytes()
        for name in self._pits_under_wheels(data) if pairs == self._seen else self.now(data):
            self.first_s.setdefault(name, time_s)
        self._seen = pairs

    def _pits_under_wheels(self, data: Any) -> list[str]:
        if not self._pits:
            return []
        wheels = data.xpos[self._wheels, :2].tolist()
        return [name for name, area in self._pits if any(area.contains(x, y) for x, y in wheels)]

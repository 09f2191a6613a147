"""The safety edge in the physics: the push of its strips, and their switches.

Up to its travel a strip pushes with a linear spring on its deepest overlap, which is the deformation of the foam; the
geoms are those of ``sim.plant.edge_model``.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.robot import SIDES, SafetyEdge
from sim.params import SimParams
from sim.plant.contacts import CHAIR
from sim.plant.drives import ServoDrives
from sim.plant.edge_model import PLATES, PREFIX, plate_travel_m

# While the number of contacts stays the same, they are searched for a strip this often: each search costs a tenth of a
# step of the physics.
_CHECK_STEPS = 10
_FRONT, _REAR, _LEFT, _RIGHT = SIDES


class Edge:
    """The strips of one robot. Call ``step`` every cycle, before the physics.

    force_n, chair_force_n: the strips' present push in all, and on the wheelchair. deformation_m: largest of each side.
    """

    def __init__(
        self, edge: SafetyEdge, model: Any, data: Any, drives: ServoDrives, part: NDArray[np.int8], params: SimParams
    ) -> None:
        self._edge, self._model, self._data, self._drives, self._part = edge, model, data, drives, part
        self._base = model.body("base").id
        names = [model.geom(index).name for index in range(model.ngeom)]
        strips = [name.startswith(PREFIX) or name in PLATES for name in names]
        self._is_strip: NDArray[np.bool_] = np.array(strips)
        self._plates = {names.index(name) for name in PLATES}
        self._plate_travel_m = plate_travel_m(edge, params)
        self._steps = 0
        self._quiet_count = 0  # of contacts while no strip is touched, else -1
        self.force_n = self.chair_force_n = 0.0
        self.deformation_m = dict.fromkeys(SIDES, 0.0)

    def step(self) -> None:
        """Pushes by the contacts of the last cycle, and sets the switches."""
        self._steps += 1
        count = self._data.ncon
        if count == self._quiet_count and self._steps % _CHECK_STEPS:
            return
        touching = bool(self._is_strip[self._data.contact.geom].any())
        was_quiet, self._quiet_count = self._quiet_count >= 0, -1 if touching else count
        if was_quiet and not touching:
            return
        self._data.qfrc_applied[:] = 0.0
        self.force_n = self.chair_force_n = 0.0
        self.deformation_m = dict.fromkeys(SIDES, 0.0)
        if touching:
            self._push()
        for side, depth_m in self.deformation_m.items():
            self._drives.set_edge_deformed(side, depth_m >= self._edge.trigger_m)

    def _push(self) -> None:
        """One spring for each strip and each body on it, at its deepest overlap."""
        pairs: dict[tuple[int, int], list[int]] = {}
        for index, (first, second) in enumerate(self._data.contact.geom.tolist()):
            if self._is_strip[first] or self._is_strip[second]:
                pairs.setdefault((first, second), []).append(index)
        for (first, second), indices in pairs.items():
            self._push_pair(first, second, indices)

    def _push_pair(self, first: int, second: int, indices: list[int]) -> None:
        contact, strip = self._data.contact, first if self._is_strip[first] else second
        depths = np.maximum(-contact.dist[indices], 0.0)
        depth_m = float(depths.max())
        if depth_m == 0.0:
            return
        place = depths @ contact.pos[indices] / depths.sum()
        # MuJoCo's normal leads from the first geom to the second.
        inward = contact.frame[indices[int(depths.argmax())], :3] * (1.0 if strip == second else -1.0)
        travel_m = self._plate_travel_m if strip in self._plates else self._edge.travel_m
        force_n = self._edge.stiffness_n_per_m * min(depth_m, travel_m)
        self._apply(self._base, force_n * inward, place)
        other = int(self._model.geom_bodyid[first if strip == second else second])
        self._apply(other, -force_n * inward, place)
        self.force_n += force_n
        if self._part[other] == CHAIR:
            self.chair_force_n += force_n
        side = _FRONT if strip in self._plates else self._side(inward)
        if side is not None:
            self.deformation_m[side] = max(self.deformation_m[side], depth_m)

    def _apply(self, body: int, force_n: NDArray[np.float64], place: NDArray[np.float64]) -> None:
        mujoco.mj_applyFT(
            self._model, self._data, force_n, np.zeros(3), np.ascontiguousarray(place), body, self._data.qfrc_applied
        )

    def _side(self, inward: NDArray[np.float64]) -> str | None:
        """The side that a push in this direction (map) meets; None from above or below, where there is no strip."""
        x, y, z = (inward @ self._data.xmat[self._base].reshape(3, 3)).tolist()
        if abs(z) > math.hypot(x, y):
            return None
        if abs(x) >= abs(y):
            return _FRONT if x < 0.0 else _REAR
        return _LEFT if y < 0.0 else _RIGHT

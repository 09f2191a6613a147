"""Cache of a static sensor's view of static objects."""

from __future__ import annotations

import numpy as np

from sim.lidar.shapes import F64, Met

# A sensor that moved less than this is static: 0.05 mm at 50 m, a four-hundredth of the ranges' noise.
_TURN, _SHIFT_M = 1e-6, 1e-6


class StillView:
    """One part of a turn. Stores only views repeated from the same place: a moving sensor costs nothing."""

    def __init__(self) -> None:
        self._origins: F64 = np.zeros((0, 3))
        self._rotations: F64 = np.zeros((0, 3, 3))
        self._seen: Met | None = None

    def recall(self, origins: F64, rotations: F64, results: Met) -> bool:
        """Fills ``results`` (columns, rings) with the stored view from these poses, if there is one.

        origins: (columns, 3) m, rotations: (columns, 3, 3), of the sensor in map.
        """
        if self._seen is None or not self._same(origins, rotations):
            return False
        ranges, hits, cosines = results
        ranges[:], hits[:], cosines[:] = self._seen
        return True

    def keep(self, origins: F64, rotations: F64, results: Met) -> None:
        """Stores a new view from these poses."""
        twice = self._same(origins, rotations)
        self._origins, self._rotations = origins, rotations
        ranges, hits, cosines = results
        self._seen = Met(ranges.copy(), hits.copy(), cosines.copy()) if twice else None

    def _same(self, origins: F64, rotations: F64) -> bool:
        return (
            len(origins) == len(self._origins)
            and bool(np.abs(origins - self._origins).max() < _SHIFT_M)
            and bool(np.abs(rotations - self._rotations).max() < _TURN)
        )

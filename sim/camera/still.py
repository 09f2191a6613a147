"""Detects that a picture would equal the last one except for the sensor's noise."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from sim.camera.conditions import Conditions

Array = NDArray[np.float64]
# Largest motion since the last composed picture: a thousandth of a pixel, and of a millimetre.
_TURN, _SHIFT_M = 1e-6, 1e-6


class StillScene:
    """Stores the poses of camera and boards of a composed picture, and its conditions."""

    def __init__(self) -> None:
        self._poses: Array = np.zeros((0, 0, 4, 4))
        self._names: tuple[str, ...] = ()
        self._conditions: Conditions | None = None

    def same(self, cameras: Array, boards: Mapping[str, Array], conditions: Conditions) -> bool:
        """True if nothing has changed since the last False, whose scene is stored. Poses: (k, 4, 4) in map.

        Drops on the lens move on their own, so a scene with rain always differs.
        """
        poses = np.array([cameras, *boards.values()])
        known = (
            conditions == self._conditions
            and conditions.rain == 0.0
            and tuple(boards) == self._names
            and bool(np.abs(poses[..., :3] - self._poses[..., :3]).max() < _TURN)
            and bool(np.abs(poses[..., 3] - self._poses[..., 3]).max() < _SHIFT_M)
        )
        if not known:
            self._poses, self._names, self._conditions = poses, tuple(boards), conditions
        return known

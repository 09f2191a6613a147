"""A plan that nobody wants any more: told by one thread, seen by the compiled searches of another."""

from __future__ import annotations

import numpy as np


class Stop:
    """flag: (1,) bool, as the compiled loops want it."""

    def __init__(self) -> None:
        self.flag = np.zeros(1, np.bool_)

    def set(self) -> None:
        self.flag[0] = True

    @property
    def wanted(self) -> bool:
        return bool(self.flag[0])

"""A cancel flag: set by one thread, polled by the compiled searches of another."""

from __future__ import annotations

import numpy as np


class CancelFlag:
    """flag: (1,) bool, the argument of the compiled loops."""

    def __init__(self) -> None:
        self.flag = np.zeros(1, np.bool_)

    def set(self) -> None:
        self.flag[0] = True

    @property
    def is_set(self) -> bool:
        return bool(self.flag[0])

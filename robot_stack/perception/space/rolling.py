"""A grid that rolls with the robot."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

NumberT = TypeVar("NumberT", bound=np.generic)


def rolled(cells: NDArray[NumberT], rows: int, columns: int, fill: float) -> NDArray[NumberT]:
    """The cells of the window after moving it by ``rows`` and ``columns``; new cells get ``fill``."""
    out = np.full_like(cells, fill)
    height, width = cells.shape[:2]
    if abs(rows) >= height or abs(columns) >= width:
        return out
    out[max(-rows, 0) : height - max(rows, 0), max(-columns, 0) : width - max(columns, 0)] = cells[
        max(rows, 0) : height - max(-rows, 0), max(columns, 0) : width - max(-columns, 0)
    ]
    return out

"""Compiled loops of the costmap. They live in one file: numba's cache checks one file only.

Grids are (rows, columns), row 0 at the lowest y.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])
Cells = NDArray[np.int8]
Floats = NDArray[np.float64]

UNKNOWN, FREE, OCCUPIED = np.int8(-1), np.int8(0), np.int8(100)
_FAR = 1e12


def compiled(function: FunctionT) -> FunctionT:
    return cast(FunctionT, numba.njit(cache=True, fastmath=False)(function))


@compiled
def _parabolas(values: Floats, out: Floats, roots: NDArray[np.int64], bounds: Floats) -> None:
    """One line of the squared distance transform: the lower envelope of the parabolas rooted at ``values``."""
    n, k = len(values), 0
    roots[0], bounds[0], bounds[1] = 0, -_FAR, _FAR
    for q in range(1, n):
        if values[q] >= _FAR:
            continue
        meet = _meet(values, q, roots[k])
        while meet <= bounds[k]:
            k -= 1
            meet = _meet(values, q, roots[k])
        k += 1
        roots[k], bounds[k], bounds[k + 1] = q, meet, _FAR
    k = 0
    for q in range(n):
        while bounds[k + 1] < q:
            k += 1
        out[q] = (q - roots[k]) ** 2 + values[roots[k]]


@compiled
def _meet(values: Floats, q: int, root: int) -> float:
    """Intersection of the parabolas rooted at two places."""
    return float((values[q] + q * q - values[root] - root * root) / (2.0 * (q - root)))


@compiled
def inflate(state: Cells, costs: Cells, out: Cells) -> None:
    """Costs around occupied cells, by the exact distance between cells' middles.

    costs: of the squared distance in cells, costs[0] that of the cell itself; beyond its end the cost is 0. An
    unknown cell gets a cost only within the inscribed radius (99); out: (rows, columns), overwritten.

    Exact distance transform: Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled Functions", Theory of
    Computing 2012.
    """
    rows, columns = state.shape
    squared = np.full((rows, columns), _FAR)
    size = max(rows, columns)
    line, result = np.empty(size), np.empty(size)
    roots, bounds = np.empty(size, np.int64), np.empty(size + 1)
    for row in range(rows):
        gap = _FAR
        for column in range(columns):
            gap = 0.0 if state[row, column] == OCCUPIED else gap + 1.0
            squared[row, column] = gap
        gap = _FAR
        for column in range(columns - 1, -1, -1):
            gap = 0.0 if state[row, column] == OCCUPIED else gap + 1.0
            gap = min(gap, squared[row, column])
            squared[row, column] = gap
    most = len(costs)
    for column in range(columns):
        for row in range(rows):
            gap = squared[row, column]
            line[row] = gap * gap if gap < _FAR else _FAR
        _parabolas(line[:rows], result[:rows], roots[:rows], bounds[: rows + 1])
        for row in range(rows):
            cost = costs[int(result[row])] if result[row] < most else FREE
            if state[row, column] == UNKNOWN and cost < 99:
                cost = UNKNOWN
            out[row, column] = cost

"""Maps of the observed area."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from robot_stack.core.robot_shape import Placed
from robot_stack.coverage.coverage import Body, Grid
from robot_stack.film.faces import faces_of

_DPI = 110
_BLIND, _THIN, _SEEN = (0.86, 0.26, 0.22), (0.95, 0.74, 0.30), (0.45, 0.75, 0.50)
_OUTSIDE = (1.0, 1.0, 1.0)
_BODY = "#606570"


def draw(grid: Grid, points: NDArray[np.int64], points_min: int, body: Body, title: str, file: Path) -> None:
    """A map from above, x ahead to the right: green seen, yellow too few points, red nothing, grey the robot."""
    rows, columns = grid.index.shape
    x0, y0 = grid.origin_m
    extent = (x0, x0 + columns * grid.cell_m, y0, y0 + rows * grid.cell_m)
    figure = Figure(figsize=(7.0, 7.0 * rows / columns + 0.6), layout="constrained")
    axes = figure.add_subplot()
    axes.imshow(colours(grid, points, points_min), origin="lower", extent=extent, interpolation="nearest")
    for item in body.solids:
        axes.add_patch(Polygon(outline(item), closed=True, facecolor=_BODY, edgecolor="none", alpha=0.55))
    axes.set(title=title, xlabel="x, m", ylabel="y, m")
    figure.savefig(file, dpi=_DPI)


def colours(grid: Grid, points: NDArray[np.int64], points_min: int) -> NDArray[np.float64]:
    """(rows, columns, 3) in [0, 1]."""
    shade = np.empty((*grid.index.shape, 3))
    shade[:] = _OUTSIDE
    inside = grid.index >= 0
    table = np.array([_BLIND, _THIN, _SEEN])
    shade[inside] = table[(points > 0).astype(int) + (points >= points_min)][grid.index[inside]]
    return shade


def outline(item: Placed) -> NDArray[np.float64]:
    """(k, 2) m, outline of a solid from above."""
    points = np.concatenate([face.points for face in faces_of([item])])[:, :2]
    return np.asarray(points[ConvexHull(points).vertices])

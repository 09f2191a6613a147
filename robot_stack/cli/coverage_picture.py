"""Maps of the observed area."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.robot_shape import Placed
from robot_stack.coverage.coverage import Body, Grid

_DPI = 110
_BLIND, _THIN, _SEEN = (0.86, 0.26, 0.22), (0.95, 0.74, 0.30), (0.45, 0.75, 0.50)
_OUTSIDE = (1.0, 1.0, 1.0)
_BODY = "#606570"
_STEPS = 24  # corners of a drawn ball or cylinder


def draw(grid: Grid, points: NDArray[np.int64], points_min: int, body: Body, title: str, file: Path) -> None:
    """A map from above, x ahead to the right: green seen, yellow too few points, red nothing, grey the robot."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon

    rows, columns = grid.index.shape
    x0, y0 = grid.origin_m
    extent = (x0, x0 + columns * grid.cell_m, y0, y0 + rows * grid.cell_m)
    figure = Figure(figsize=(7.0, 7.0 * rows / columns + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
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
    from scipy.spatial import ConvexHull

    half = 0.5 * np.array(item.solid.size_m)
    if item.solid.kind == "box":
        corners = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]) * half
    else:
        angle = np.linspace(0.0, 2.0 * np.pi, _STEPS, endpoint=False)
        ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(_STEPS)], axis=1)
        rings = [ring + np.array((0.0, 0.0, z)) for z in (-1.0, 1.0)] if item.solid.kind == "cylinder" else [ring]
        corners = np.concatenate(rings) * half
    flat = (corners @ item.pose[:3, :3].T + item.pose[:3, 3])[:, :2]
    hull: NDArray[np.float64] = flat[ConvexHull(flat).vertices]
    return hull

"""Draws a map: the grid, the cells from above, the path, the loops."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from robot_stack.cli.errors import writing
from robot_stack.core.route_graph import RouteGraph
from robot_stack.core.site_map import FREE, OCCUPIED, UNKNOWN, Grid, SiteMap, shaded
from robot_stack.core.zones import Zone, ZoneType

_DPI = 110
GREYS = {FREE: 247, OCCUPIED: 25, UNKNOWN: 200}
_LONGEST_IN = 16.0
_WALL_FROM_M = 0.1

Places = npt.NDArray[np.float64]


_ZONE_COLOURS = {
    ZoneType.KEEPOUT: "tab:red",
    ZoneType.SPEED: "tab:blue",
    ZoneType.ONE_WAY: "tab:green",
    ZoneType.DOOR: "tab:purple",
}


def draw_map(
    site: SiteMap,
    file: Path,
    ways: Sequence[Places] = (),
    loops: Places | None = None,
    zones: tuple[Zone, ...] = (),
    graph: RouteGraph | None = None,
) -> None:
    """ways: (n, 2) m each, the robot's paths; loops: (n, 2, 2) m, pairs of recognised places. Raises CommandError."""
    from matplotlib.collections import EllipseCollection, LineCollection
    from matplotlib.figure import Figure

    grid = site.grid
    rows, columns = grid.occupancy.shape
    width_m, height_m = columns * grid.resolution_m, rows * grid.resolution_m
    scale = _LONGEST_IN / max(width_m, height_m)
    figure = Figure(figsize=(width_m * scale, height_m * scale + 0.6), layout="constrained")
    axes = figure.add_subplot()
    draw_grid(axes, grid)
    widths, heights, angles, colours, places = _ellipses(site)
    cells = EllipseCollection(
        widths, heights, angles, units="xy", offsets=places, offset_transform=axes.transData, cmap="viridis", alpha=0.55
    )
    cells.set_array(colours)
    axes.add_collection(cells)
    for number, way in enumerate(ways):
        colour = "tab:orange" if not number else f"C{1 + number}"
        axes.plot(
            way[:, 0], way[:, 1], color=colour, linewidth=1.2, label="ride" if not number else f"ride {number + 1}"
        )
        axes.plot(*way[0], "o", color="tab:green", label=None if number else "begin")
        axes.plot(*way[-1], "s", color="tab:red", label=None if number else "end")
    if loops is not None and len(loops):
        axes.add_collection(LineCollection(list(loops), colors="tab:red", linewidths=1.0, label="loops"))
    for zone in zones:
        colour = _ZONE_COLOURS[zone.type]
        for ring in zone.rings:
            axes.plot(ring[:, 0], ring[:, 1], color=colour, linewidth=1.6)
        if zone.type is ZoneType.ONE_WAY:
            x, y = zone.rings[0][:-1].mean(axis=0)
            axes.quiver(x, y, math.cos(zone.heading_rad), math.sin(zone.heading_rad), color=colour, angles="xy")
        axes.annotate(zone.name, zone.rings[0].mean(axis=0), color=colour, ha="center", va="center")
    if graph is not None:
        for start, end in graph.points[graph.ends]:
            axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": "tab:purple", "linewidth": 1.4})
    axes.set(xlabel="x in map, m", ylabel="y in map, m", aspect="equal")
    axes.set(xlim=(grid.origin_x_m, grid.origin_x_m + width_m), ylim=(grid.origin_y_m, grid.origin_y_m + height_m))
    axes.set_title(f"{site.name}: {len(site.cells.count)} cells of {site.cells.size_m:g} m, one deviation; by height")
    if ways:
        axes.legend(loc="upper right")
    with writing(file):
        figure.savefig(file, dpi=_DPI)


def draw_grid(axes: Any, grid: Grid) -> None:
    """The occupancy as grey cells, axes in m of the map."""
    rows, columns = grid.occupancy.shape
    x, y, size_m = grid.origin_x_m, grid.origin_y_m, grid.resolution_m
    extent = (x, x + columns * size_m, y, y + rows * size_m)
    shade = shaded(grid.occupancy, GREYS)
    axes.imshow(shade, origin="lower", extent=extent, cmap="gray", vmin=0.0, vmax=255.0, interpolation="nearest")


def _ellipses(site: SiteMap) -> tuple[Places, Places, Places, Places, Places]:
    """(widths, heights, angles in deg, heights above the map's origin, centres) of the cells above the ground."""
    c = site.cells
    values, vectors = np.linalg.eigh(c.covariance[:, :2, :2])
    upright = (c.covariance[:, 2, 2] > 0.05**2) | (c.mean[:, 2] > _WALL_FROM_M)
    size = 2.0 * np.sqrt(np.maximum(values[upright], 1e-6))
    angle = np.degrees(np.arctan2(vectors[upright, 1, 1], vectors[upright, 0, 1]))
    order = np.argsort(c.mean[upright, 2])
    return size[order, 1], size[order, 0], angle[order], c.mean[upright, 2][order], c.mean[upright, :2][order]

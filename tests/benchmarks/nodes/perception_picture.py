"""The newest obstacles, end of known space and costmap, side by side."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from robot_stack.contract import topics
from robot_stack.core.point_cloud import XYZ, xyz_of
from robot_stack.middleware.point_cloud import points_of

_HALF_M = 10.0


def draw(file: Path, latest: Mapping[str, Any]) -> Path:
    """latest: newest message by topic name; missing ones are left empty."""
    figure = Figure(figsize=(18, 9), dpi=80, layout="constrained")
    left, right = figure.subplots(1, 2)
    cloud, ends, grid = (latest.get(row.name) for row in (topics.OBSTACLES, topics.UNSEEN_SPACE, topics.LOCAL_COSTMAP))
    if ends is not None:
        xyz = xyz_of(points_of(ends, XYZ))
        left.scatter(xyz[:, 0], xyz[:, 1], s=6.0, c="#d08080", label="where known space ends")
    if cloud is not None:
        xyz = xyz_of(points_of(cloud, XYZ))
        dots = left.scatter(xyz[:, 0], xyz[:, 1], s=3.0, c=xyz[:, 2], cmap="viridis", vmin=0.0, vmax=2.0)
        figure.colorbar(dots, ax=left, label="z, m", shrink=0.7)
    left.plot([0.0], [0.0], "r+", markersize=12)
    left.set(xlim=(-_HALF_M, _HALF_M), ylim=(-_HALF_M, _HALF_M), aspect="equal", title="obstacles, base_link")
    if grid is not None:
        info = grid.info
        cost = np.asarray(grid.data, dtype=np.int16).reshape(info.height, info.width)
        x0, y0 = info.origin.position.x, info.origin.position.y
        extent = (x0, x0 + info.width * info.resolution, y0, y0 + info.height * info.resolution)
        shown = np.ma.masked_less(cost, 0)
        right.set_facecolor("#a0a0a8")
        image = right.imshow(shown, origin="lower", extent=extent, cmap="magma_r", vmin=0, vmax=100)
        figure.colorbar(image, ax=right, label="cost", shrink=0.7)
    right.set(aspect="equal", title="local costmap, odom (grey: unknown)")
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file)
    return file

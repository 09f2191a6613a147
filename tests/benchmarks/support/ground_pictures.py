"""Top views of segmented sweeps, coloured by the class of each point."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from robot_stack.perception import cells as ground
from robot_stack.perception.sensor_view import Segmented
from tests.benchmarks.support.ground_scenes import Shot

_CLASSES = (
    (ground.GROUND, "#b8b8b0", "ground"),
    (ground.LOW, "#f0a020", "low"),
    (ground.HIGH, "#80b0ff", "high"),
    (ground.OBSTACLE, "#1a3fd0", "obstacle"),
    (ground.KERB, "#d01060", "kerb"),
)
_HALF_M = 12.0


def draw(
    folder: Path,
    shot: Shot,
    xyz: NDArray[np.float32],
    seen: Segmented,
    truth: NDArray[np.bool_],
    counts: NDArray[np.bool_],
) -> None:
    """Left: classes. Right: missed ground and false ground. base_link in the middle, x to the right."""
    folder.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(20, 10), dpi=80, layout="constrained")
    left, right = figure.subplots(1, 2)
    for label, colour, name in _CLASSES:
        mask = seen.labels == label
        left.scatter(xyz[mask, 0], xyz[mask, 1], s=1.0, c=colour, label=f"{name} {int(mask.sum())}", linewidths=0)
    _directions(left, seen)
    found = seen.labels == ground.GROUND
    right.scatter(xyz[:, 0], xyz[:, 1], s=0.5, c="#dddddd", linewidths=0)
    for mask, colour, name in (
        (~found & truth & counts, "#d02020", "ground missed"),
        (found & ~truth & counts, "#2020d0", "ground invented"),
    ):
        right.scatter(xyz[mask, 0], xyz[mask, 1], s=2.0, c=colour, label=f"{name} {int(mask.sum())}", linewidths=0)
    for axes, title in ((left, shot.name), (right, "against the truth")):
        axes.set(xlim=(-_HALF_M, _HALF_M), ylim=(-_HALF_M, _HALF_M), aspect="equal", title=title)
        axes.legend(loc="upper right", markerscale=6)
    figure.savefig(folder / f"{shot.name}.png")


def _directions(axes: object, seen: Segmented) -> None:
    """The end of free ground by direction, and the edges of drop-offs."""
    sectors = len(seen.profile.free_m)
    angles = (np.arange(sectors) + 0.5) * (2.0 * np.pi / sectors) - np.pi
    for values, style, name in ((seen.profile.free_m, "g.", "free ground ends"), (seen.profile.drop_m, "kx", "edge")):
        there = values > 0.0
        x, y = 0.2 + values * np.cos(angles), values * np.sin(angles)
        axes.plot(x[there], y[there], style, markersize=3, label=f"{name} {int(there.sum())}")  # type: ignore[attr-defined]

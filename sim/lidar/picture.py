"""Top views of a sweep, coloured by what its points lie on."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.point_cloud import Points
from sim.lidar.labels import NAMES

_COLORS = (
    "#b8b8b8",
    "#d08a2e",
    "#e03030",
    "#5a4632",
    "#3a6ea5",
    "#2e8b57",
    "#8a2be2",
    "#ff1493",
    "#008b8b",
    "#000000",
    "#7b3f00",
    "#00bfff",
    "#ffd700",
)


def draw_sweep(
    points: Points, labels: NDArray[np.uint8], path: Path, *, reach_m: float = 20.0, title: str = ""
) -> None:
    """Writes a picture: from above to the left, the ground near the sensor from the side to the right. Sensor frame."""
    figure, (above, side) = plt.subplots(1, 2, figsize=(20, 10), dpi=80)
    for label in np.unique(labels):
        mine = points[labels == label]
        look = {"s": 0.8, "c": _COLORS[label], "linewidths": 0}
        above.scatter(mine["x"], mine["y"], label=f"{NAMES[label]} {len(mine)}", **look)
        strip = mine[np.abs(mine["y"]) < 1.0]
        side.scatter(strip["x"], strip["z"], **look)
    above.set(
        xlim=(-reach_m, reach_m), ylim=(-reach_m, reach_m), aspect="equal", xlabel="x, m", ylabel="y, m", title=title
    )
    side.set(xlim=(-reach_m, reach_m), ylim=(-1.5, 3.0), xlabel="x, m", ylabel="z, m", title="|y| < 1 m")
    above.legend(markerscale=8, loc="upper right")
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    plt.close(figure)

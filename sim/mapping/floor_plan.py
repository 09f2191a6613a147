"""The floor plan of a world, its walls and panes alone: ``python -m sim.mapping.floor_plan WORLD PICTURE.png``.

Prints the options of ``robot-stack map plan`` for the picture.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sim.worldfile import WorldFile, load_world

RESOLUTION_M = 0.05


def walls_of(world: WorldFile) -> NDArray[np.bool_]:
    """(rows, columns), row 0 at the lowest y: pixels of RESOLUTION_M whose middle is in a wall, at least one wide."""
    floor = world.floor
    x, y = np.meshgrid(
        np.arange(floor.min_x_m, floor.max_x_m - 1e-6, RESOLUTION_M) + 0.5 * RESOLUTION_M,
        np.arange(floor.min_y_m, floor.max_y_m - 1e-6, RESOLUTION_M) + 0.5 * RESOLUTION_M,
    )
    walls = np.zeros(x.shape, np.bool_)
    for wall in world.walls:
        c, s = np.cos(wall.yaw_rad), np.sin(wall.yaw_rad)
        along, across = c * (x - wall.x_m) + s * (y - wall.y_m), c * (y - wall.y_m) - s * (x - wall.x_m)
        half_m = 0.5 * max(wall.width_m, RESOLUTION_M)
        walls |= (np.abs(along) <= 0.5 * wall.length_m) & (np.abs(across) <= half_m)
    return walls


def main(arguments: list[str]) -> int:
    if len(arguments) != 2:
        print("usage: python -m sim.mapping.floor_plan WORLD PICTURE.png", file=sys.stderr)
        return 2
    world, picture = load_world(arguments[0]), Path(arguments[1])
    Image.fromarray(~walls_of(world)[::-1]).save(picture, optimize=True)
    corner, start = (world.floor.min_x_m, world.floor.min_y_m), world.start
    print(f"--resolution {RESOLUTION_M} --origin {corner[0]:g} {corner[1]:g} 0 --start {start.x_m:g} {start.y_m:g}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))

"""Renders the board of chair_1 with MuJoCo as a textured quad and writes the picture: run as a program.

Arguments: the file to write, then distance, lateral offset and yaw of the camera to the board (m, m, rad).
"""

from __future__ import annotations

import math
import os
import sys

os.environ.setdefault("MUJOCO_GL", "egl")

import cv2
import mujoco
import numpy as np

from sim.camera.panels import build_panels
from tests.unit.sim.camera.bench import DOCKS, PARAMS

WIDTH, HEIGHT, FOCAL_PX = 1280, 720, 900.0
_TEXELS_PER_CELL = 16


def board_texture() -> tuple[np.ndarray, tuple[float, float]]:
    """The panel as an image, and its width and height in m."""
    panel = next(panel for panel in build_panels(DOCKS, PARAMS.board) if panel.dock == "chair_1")
    cell_m = DOCKS.marker_size_m / 6
    texels_per_m = _TEXELS_PER_CELL / cell_m
    left, right, low, high = panel.rect
    width, height = round((right - left) * texels_per_m), round((high - low) * texels_per_m)
    image = np.full((height, width), round(255 * PARAMS.board.panel), np.uint8)
    for (grid_left, grid_top, _), black in zip(panel.grids, panel.black, strict=True):
        cells = np.where(black, 255 * PARAMS.board.black, 255 * PARAMS.board.white).astype(np.uint8)
        marker = np.kron(cells, np.ones((_TEXELS_PER_CELL, _TEXELS_PER_CELL), np.uint8))
        x, y = round((grid_left - left) * texels_per_m), round((high - grid_top) * texels_per_m)
        image[y : y + marker.shape[0], x : x + marker.shape[1]] = marker
    return image, (width / texels_per_m, height / texels_per_m)


def main(path: str, distance_m: float, left_m: float, yaw_rad: float) -> None:
    image, (width_m, height_m) = board_texture()
    _, png = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    # The board is at x = 0 in the dock frame and faces -x; the camera looks along x.
    y, low, high = 0.5 * width_m, 0.45 - 0.5 * height_m, 0.45 + 0.5 * height_m
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    fovy = math.degrees(2.0 * math.atan(0.5 * HEIGHT / FOCAL_PX))
    # MuJoCo needs a hull, but the quad is flat: a point far behind it gives the mesh a volume.
    eye = f'pos="{-distance_m} {left_m} 0.45" xyaxes="{s} {-c} 0 0 0 1" fovy="{fovy}"'
    xml = f"""<mujoco><visual><global offwidth="{WIDTH}" offheight="{HEIGHT}"/><map znear="0.01"/>
      <quality offsamples="0"/><headlight ambient="0 0 0" diffuse="0 0 0" specular="0 0 0"/></visual>
      <asset><texture name="board" type="2d" file="board.png"/>
        <material name="board" texture="board" emission="1" specular="0" shininess="0"/>
        <mesh name="quad" vertex="0 {y} {high} 0 {-y} {high} 0 {-y} {low} 0 {y} {low} 0.1 0 0.45"
          texcoord="0 1 1 1 1 0 0 0 0.5 0.5" face="0 2 1 0 3 2 0 1 4 1 2 4 2 3 4 3 0 4"/></asset>
      <worldbody><body><geom type="mesh" mesh="quad" material="board" contype="0" conaffinity="0"/></body>
        <camera name="eye" {eye}/></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml, {"board.png": png.tobytes()})
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        renderer.update_scene(data, "eye")
        cv2.imwrite(path, renderer.render()[:, :, 0])


if __name__ == "__main__":
    main(sys.argv[1], *map(float, sys.argv[2:5]))

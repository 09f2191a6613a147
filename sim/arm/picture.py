"""A picture of the arm: ``python -m sim.arm.picture --output arm.png [--joints RAD,RAD,RAD,RAD,RAD,RAD]``.

Renders off screen; see ``sim.pictures.picture`` for the requirements.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

os.environ.setdefault("MUJOCO_GL", "egl")

import cv2
import mujoco

from robot_stack.core.config import load
from sim.arm.params import N_JOINTS, ArmParams
from sim.arm.world import ArmWorld

_ABOVE_THE_CUBE = (-0.081, 0.780, 2.222, -1.431, -1.571, -0.081)
_SIZE = (960, 540)
_SAMPLES = 2  # per pixel and direction


def render(params: ArmParams) -> NDArray[np.uint8]:
    """(540, 960, 3) RGB of the arm as ``params`` start it."""
    world = ArmWorld(params, 0.001)
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance = (0.14, 0.05, 0.34), 1.15
    camera.azimuth, camera.elevation = 118.0, -16.0
    width, height = _SIZE
    renderer = mujoco.Renderer(world.model, _SAMPLES * height, _SAMPLES * width)
    try:
        renderer.update_scene(world.data, camera)
        fine = renderer.render().reshape(height, _SAMPLES, width, _SAMPLES, 3)
    finally:
        renderer.close()
    return np.asarray(fine.mean(axis=(1, 3)).round(), np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(description="A picture of the simulated arm.")
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--joints", default=",".join(map(str, _ABOVE_THE_CUBE)), help="six angles in rad")
    arguments = parser.parse_args()
    joints = tuple(float(part) for part in arguments.joints.split(","))
    if len(joints) != N_JOINTS:
        parser.error(f"--joints: must be {N_JOINTS} angles")
    params = load(ArmParams, "sim_manipulator")
    picture = render(params.model_copy(update={"start_rad": joints}))
    cv2.imwrite(str(arguments.output), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))


if __name__ == "__main__":
    main()

"""A picture of the arm: ``python -m sim.arm.picture --output arm.png [--joints RAD,RAD,RAD,RAD,RAD,RAD]``.

Renders off screen; see ``sim.pictures.picture`` for the requirements.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

if __name__ == "__main__":  # not for an importing module: without EGL, mujoco could then not be imported at all
    os.environ.setdefault("MUJOCO_GL", "egl")

import PIL.Image

from robot_stack.core.config import load
from sim.arm.params import N_JOINTS, ArmParams
from sim.arm.world import ArmWorld
from sim.pictures.picture import View, render

_ABOVE_THE_CUBE = (-0.081, 0.780, 2.222, -1.431, -1.571, -0.081)
_VIEW = View((0.14, 0.05, 0.34), 1.15, 118.0, -16.0)
_SIZE = (960, 540)


def main() -> None:
    parser = argparse.ArgumentParser(description="A picture of the simulated arm.")
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--joints", default=",".join(map(str, _ABOVE_THE_CUBE)), help="six angles in rad")
    arguments = parser.parse_args()
    joints = tuple(float(part) for part in arguments.joints.split(","))
    if len(joints) != N_JOINTS:
        parser.error(f"--joints: must be {N_JOINTS} angles")
    params = load(ArmParams, "sim_manipulator")
    world = ArmWorld(params.model_copy(update={"start_rad": joints}), 0.001)
    PIL.Image.fromarray(render(world.model, world.data, _VIEW, _SIZE)).save(arguments.output)


if __name__ == "__main__":
    main()

"""Compiles the kernels of the simulated cameras, or loads them."""

from __future__ import annotations

import numpy as np

from robot_stack.contract.frames import FRONT_CAMERA
from robot_stack.core.camera import Intrinsics, mounting
from robot_stack.core.docks import load_docks
from robot_stack.core.robot import load_robot
from sim.camera.model import TrueCamera
from sim.camera.motion import Motion
from sim.camera.params import load_camera_params
from sim.camera.render import Renderer
from sim.camera.scenery import build_scenery

_SMALL = Intrinsics(160, 90, 112.0, 112.0, 79.5, 44.5, (0.0, 0.0, 0.0, 0.0, 0.0))
_AHEAD_M = 2.0


def warm_up() -> None:
    """One small picture with a board in view."""
    docks, random = load_docks(), np.random.default_rng(0)
    camera = TrueCamera(FRONT_CAMERA, _SMALL, mounting(load_robot(), FRONT_CAMERA))
    board = np.eye(4)
    board[0, 3] = _AHEAD_M
    renderer = Renderer(camera, docks, load_camera_params(), random, build_scenery((), docks))
    renderer.render(Motion.still(np.eye(4), dict.fromkeys(docks.docks, board)))

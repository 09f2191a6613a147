"""The same board in MuJoCo's renderer has its edges at the same places."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from robot_stack.core.camera import Intrinsics
from sim.camera.model import TrueCamera
from sim.camera.motion import Motion
from tests.unit.sim.camera.bench import (
    DOCKS,
    FRAME,
    NOMINAL,
    edge_errors,
    marker_sides,
    place,
    project_on,
    renderer,
    sharp,
)

ROOT = Path(__file__).resolve().parents[4]
PINHOLE = TrueCamera(FRAME, Intrinsics(1280, 720, 900.0, 900.0, 639.5, 359.5, (0.0,) * 5), NOMINAL)
NO_GL = ("EGL", "OpenGL", "libGL", "gladLoadGL")


def by_mujoco(path: Path, distance_m: float, left_m: float, yaw_rad: float) -> np.ndarray:
    command = [sys.executable, "-m", "tests.unit.sim.camera.mujoco_board", str(path)]
    environment = {**os.environ, "MUJOCO_GL": "egl"}
    arguments = [str(value) for value in (distance_m, left_m, yaw_rad)]
    done = subprocess.run([*command, *arguments], cwd=ROOT, env=environment, capture_output=True, text=True)
    if done.returncode and any(word in done.stderr for word in NO_GL):
        pytest.skip("this machine has no EGL: libegl1 and libgl1-mesa-dri are missing")
    assert done.returncode == 0, done.stderr
    return cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)


@pytest.mark.parametrize(("distance_m", "left_m", "yaw_rad"), [(0.6, 0.0, 0.0), (0.9, 0.25, -0.2)])
def test_edges_agree(tmp_path: Path, distance_m: float, left_m: float, yaw_rad: float) -> None:
    theirs = by_mujoco(tmp_path / "board.png", distance_m, left_m, yaw_rad)
    # base_link such that the nominal camera, 0.35 m ahead of it, is at MuJoCo's camera.
    base = place(-distance_m, left_m, yaw_rad) @ place(-0.35, 0.0)
    ours = renderer(PINHOLE, sharp()).render(Motion.still(base, {"chair_1": np.eye(4)}))
    for marker in DOCKS.docks["chair_1"].markers:
        sides = [project_on(PINHOLE, side, np.eye(4), base) for side in marker_sides(marker)]
        apart = edge_errors(ours, sides) - edge_errors(theirs, sides)
        assert len(apart) > 300
        # MuJoCo samples a pixel at its centre, which limits the accuracy of an edge along one line.
        assert np.abs(apart).max() < 0.1

"""Pictures of the robot, rendered off screen in a separate process."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib import image


def picture(*options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "sim.pictures.picture", "--width", "320", "--height", "180", *options]
    environment = {**os.environ, "MUJOCO_GL": "egl"}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_the_robot_is_in_its_picture(tmp_path: Path) -> None:
    path = tmp_path / "robot.png"
    done = picture("--output", str(path), "--world", "flat", "--after", "0.2", "--speed", "0", "--turn", "0")
    if "EGL" in done.stderr or "OpenGL" in done.stderr:
        pytest.skip("this machine has no EGL: libegl1 and libgl1-mesa-dri are missing")
    assert done.returncode == 0, done.stderr
    pixels = image.imread(path)
    assert pixels.shape[:2] == (180, 320)
    red, green, blue = (pixels[..., channel].astype(float) for channel in range(3))
    stripe = (red > 0.5) & (red > 1.5 * green) & (green > blue)
    assert 20 < np.count_nonzero(stripe) < 2000, "the orange stripe of its front"


@pytest.mark.parametrize("module", ["sim.pictures.picture", "sim.arm.picture"])
def test_importing_it_requests_no_egl(module: str) -> None:
    """Set-up imports every module, also on a machine without EGL, on which mujoco could then not be imported."""
    environment = {name: value for name, value in os.environ.items() if name != "MUJOCO_GL"}
    program = f"import os, {module}; print(os.environ.get('MUJOCO_GL'))"
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "None\n"

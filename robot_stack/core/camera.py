"""Cameras: intrinsics (``config/cameras/<frame>.yaml``, the format of ROS camera_info files) and mounting.

A camera's frame is its optical frame: z along the view, x to the right and y down in the image. Pixel (0, 0) is the
centre of the first pixel, as in OpenCV.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial.transform import Rotation

from robot_stack.contract.frames import FRONT_CAMERA, REAR_CAMERA
from robot_stack.core.config import Config, config_dir, read_yaml, validate
from robot_stack.core.robot import Robot

# Optical axes as columns (x, y, z) in base_link, of a camera that looks forwards and of one that looks backwards.
_FORWARDS = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_BACKWARDS = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """Pinhole with Brown-Conrady distortion (k1, k2, p1, p2, k3), "plumb_bob" in ROS. All but distortion in pixels."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float]

    def matrix(self) -> NDArray[np.float64]:
        """(3, 3) camera matrix."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def coefficients(self) -> NDArray[np.float64]:
        """(5,) distortion coefficients."""
        return np.array(self.distortion)


class _Matrix(Config):
    rows: int
    cols: int
    data: list[float]


class _CameraInfoFile(Config):
    """What camera_calibration_parsers writes and reads."""

    image_width: Annotated[int, Field(gt=0)]
    image_height: Annotated[int, Field(gt=0)]
    camera_name: str
    camera_matrix: _Matrix
    distortion_model: Literal["plumb_bob"]
    distortion_coefficients: _Matrix
    rectification_matrix: _Matrix
    projection_matrix: _Matrix


def camera_file(frame: str) -> Path:
    """``config/cameras/<frame>.yaml``."""
    return config_dir() / "cameras" / f"{frame}.yaml"


def load_intrinsics(path: Path) -> Intrinsics:
    """A camera_info YAML file. Raises ConfigError."""
    file = validate(_CameraInfoFile, read_yaml(path), str(path))
    k, d = file.camera_matrix.data, file.distortion_coefficients.data
    return Intrinsics(file.image_width, file.image_height, k[0], k[4], k[2], k[5], (d[0], d[1], d[2], d[3], d[4]))


def write_intrinsics(path: Path, frame: str, intrinsics: Intrinsics) -> None:
    """Writes a camera_info YAML file. Raises OSError."""
    k = intrinsics.matrix()
    data = {
        "image_width": intrinsics.width,
        "image_height": intrinsics.height,
        "camera_name": frame,
        "camera_matrix": _matrix(k),
        "distortion_model": "plumb_bob",
        "distortion_coefficients": _matrix(intrinsics.coefficients().reshape(1, 5)),
        "rectification_matrix": _matrix(np.eye(3)),
        "projection_matrix": _matrix(np.c_[k, np.zeros(3)]),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(data, sort_keys=False, default_flow_style=None), encoding="utf-8")


def _matrix(values: NDArray[np.float64]) -> dict[str, object]:
    rows, cols = values.shape
    return {"rows": rows, "cols": cols, "data": [float(value) for value in values.ravel()]}


def mounting(robot: Robot, frame: str) -> NDArray[np.float64]:
    """(4, 4) nominal pose of a camera's optical frame in base_link. Raises KeyError for a frame that is no camera."""
    axes, place, rpy_deg = {
        FRONT_CAMERA: (_FORWARDS, robot.front_camera_xyz_m, robot.front_camera_rpy_deg),
        REAR_CAMERA: (_BACKWARDS, robot.rear_camera_xyz_m, robot.rear_camera_rpy_deg),
    }[frame]
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", rpy_deg, degrees=True).as_matrix() @ axes
    pose[:3, 3] = place
    return pose


def turned_by_deg(rotation: NDArray[np.float64], frame: str) -> tuple[float, float, float]:
    """The ``rpy_deg`` of a camera whose optical frame has this orientation (3, 3) in base_link. Raises KeyError."""
    axes = {FRONT_CAMERA: _FORWARDS, REAR_CAMERA: _BACKWARDS}[frame]
    roll, pitch, yaw = Rotation.from_matrix(rotation @ axes.T).as_euler("xyz", degrees=True).tolist()
    return roll, pitch, yaw

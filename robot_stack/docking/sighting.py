"""The dock's pose relative to the robot, from marker poses in a camera."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.docks import Dock, MarkerPlace
from robot_stack.core.geometry import Pose2

# ArucoDetection.quality_score = 1 / (1 + (s / 0.01 m)^2), at most 0.2 where the orientation is ambiguous.
_QUALITY_SCALE_M = 0.01
_AMBIGUOUS = 0.2 + 1e-3  # the message's float32 rounds 0.2 up
_ORTHONORMAL = 1e-3
_EYE = np.eye(3)


@dataclass(frozen=True, slots=True)
class Marker:
    """One entry of /docking/aruco_detections. pose: (4, 4) marker in the camera's optical frame, m."""

    stamp_s: float
    camera_frame: str
    marker_id: int
    pose: NDArray[np.float64]
    quality: float


@dataclass(frozen=True, slots=True)
class Sighting:
    """The dock in one image: its pose in base_link, standard deviation of the position, m.

    yaw_known is False if the board is so far or frontal that its orientation is ambiguous.
    """

    stamp_s: float
    dock: Pose2
    sigma_m: float
    yaw_known: bool
    markers: int


def sighting(markers: Sequence[Marker], dock: Dock, mounting: NDArray[np.float64]) -> Sighting | None:
    """The sighting of ``dock`` in one image; None if the image shows none of its markers or their poses are unusable.

    markers: of one image, any dock's. mounting: (4, 4) camera in base_link.

    The detector solves the pose of a board from all its corners jointly, so its best entry stands for all of them. The
    board's middle is projected on the ground, not the dock's origin below it: an error in the camera's pitch would move
    that by its height.
    """
    own = [item for item in markers if item.marker_id in dock.markers and _usable(item)]
    if not own:
        return None
    best = max(own, key=lambda item: item.quality)
    board = mounting @ best.pose @ np.linalg.inv(dock.markers[best.marker_id].pose())
    x_m, y_m, z_m = (sum(values) / len(values) for values in zip(*map(_place, dock.markers.values()), strict=True))
    middle = board @ np.array([x_m, y_m, z_m, 1.0])
    seen = Pose2(float(middle[0]), float(middle[1]), math.atan2(board[1, 0], board[0, 0]))
    pose = seen.compose(Pose2(-x_m, -y_m, 0.0))
    sigma_m = _QUALITY_SCALE_M * math.sqrt(1.0 / min(best.quality, 1.0) - 1.0)
    return Sighting(best.stamp_s, pose, sigma_m, best.quality > _AMBIGUOUS, len(own)) if pose.is_finite() else None


def _place(marker: MarkerPlace) -> tuple[float, float, float]:
    return marker.x_m, marker.y_m, marker.z_m


def _usable(marker: Marker) -> bool:
    if not (0.0 < marker.quality < math.inf and math.isfinite(marker.stamp_s) and np.isfinite(marker.pose).all()):
        return False
    rotation = marker.pose[:3, :3]
    return bool(np.abs(rotation @ rotation.T - _EYE).max() < _ORTHONORMAL)

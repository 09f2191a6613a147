"""A camera with a fixed viewing direction that follows a point smoothly."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from robot_stack.film.params import Camera

Floats = NDArray[np.float64]
_NEAR_M = 0.3


class View:
    """The camera at one moment. at_m: (2,) its target on the ground, map. size_px: width, height."""

    def __init__(self, camera: Camera, at_m: Floats, size_px: tuple[int, int]) -> None:
        azimuth, elevation = math.radians(camera.azimuth_deg), math.radians(camera.elevation_deg)
        flat = math.cos(elevation)
        ahead = np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), -math.sin(elevation)])
        right = np.array([math.sin(azimuth), -math.cos(azimuth), 0.0])
        self.axes = np.stack([right, np.cross(ahead, right), ahead])  # rows: right, down, ahead
        self.eye = np.array([*at_m, 0.0]) - camera.distance_m * ahead
        self._focal_px = 0.5 * size_px[0] / math.tan(0.5 * math.radians(camera.field_of_view_deg))
        self._middle = 0.5 * np.array(size_px, dtype=np.float64)

    def depth_m(self, points: Floats) -> Floats:
        """(n,) distance ahead of the camera of (n, 3) points in map, m."""
        return np.asarray((points - self.eye) @ self.axes[2])

    def pixels(self, points: Floats) -> Floats:
        """(n, 2) of (n, 3) points in map. Points behind the camera land far outside."""
        seen = (points - self.eye) @ self.axes.T
        depth = np.maximum(seen[:, 2:], _NEAR_M)
        return np.asarray(self._middle + self._focal_px * seen[:, :2] / depth)

    def ground(self) -> Floats:
        """(3, 3) homography from x, y, 1 on the ground of map, m, to pixels."""
        lens = np.array([[self._focal_px, 0.0, self._middle[0]], [0.0, self._focal_px, self._middle[1]], [0, 0, 1.0]])
        turned = np.stack([self.axes[:, 0], self.axes[:, 1], -self.axes @ self.eye], axis=1)
        return np.asarray(lens @ turned)


def followed(points: Floats, calm_frames: float) -> Floats:
    """(n, 2) the camera's target in each frame: the points, smoothed symmetrically, without lag. calm_frames: standard
    deviation of the filter; 0 changes nothing.
    """
    return gaussian_filter1d(points, calm_frames, axis=0, mode="nearest") if calm_frames > 0.0 else points

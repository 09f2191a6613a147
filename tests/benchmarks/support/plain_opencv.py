"""Marker detection with OpenCV alone, as a reference for the marker detector."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.camera import Intrinsics
from robot_stack.core.docks import Docks, board_corners

Array = NDArray[np.float64]


class PlainOpenCv:
    """ArucoDetector's defaults with CORNER_REFINE_SUBPIX, IPPE of the whole board, solvePnPRefineLM."""

    def __init__(self, docks: Docks, dock: str, intrinsics: Intrinsics) -> None:
        settings = cv2.aruco.DetectorParameters()
        settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, docks.dictionary))
        self._detector = cv2.aruco.ArucoDetector(dictionary, settings)
        self._corners = board_corners(docks.docks[dock].markers, docks.marker_size_m)
        self._camera = intrinsics.matrix(), intrinsics.coefficients()
        # IPPE requires the board in the plane z = 0: x right and y up, from the viewer's side.
        self._axes = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])

    def detect(self, image: NDArray[np.uint8]) -> Array | None:
        """(4, 4) dock in the camera frame."""
        corners, ids, _ = self._detector.detectMarkers(image)
        numbers = [int(number) for number in np.ravel(np.asarray(ids if len(corners) else []))]
        known = [(number, quad) for number, quad in zip(numbers, corners, strict=True) if number in self._corners]
        if not known:
            return None
        model = np.concatenate([self._corners[number] for number, _ in known]) @ self._axes.T
        seen = np.concatenate([quad.reshape(4, 2) for _, quad in known]).astype(np.float64)
        _, turn, shift = cv2.solvePnP(model, seen, *self._camera, flags=cv2.SOLVEPNP_IPPE)
        turn, shift = cv2.solvePnPRefineLM(model, seen, *self._camera, turn, shift)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(turn)[0] @ self._axes, np.ravel(shift)
        return pose

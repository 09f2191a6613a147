"""The marker detector: an image in, poses of markers out."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.camera import Intrinsics
from robot_stack.core.docks import Docks
from robot_stack.docking.vision.board import Board, Boards
from robot_stack.docking.vision.edges import camera_vector, distort_points, fit_sides, undistort_points
from robot_stack.docking.vision.params import DetectorParams
from robot_stack.docking.vision.pose import BoardPose, MarkerSides, board_pose, group_by_board, marker_sides
from robot_stack.docking.vision.search import MarkerSearch, Region, around, whole

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

_LARGEST_SHRINK = 4


@dataclass(frozen=True, slots=True)
class MarkerObservation:
    """One marker in one image.

    pose: (4, 4) marker in the camera frame, m, from all corners of its board jointly.
    quality: [0, 1]: 1 / (1 + (position_sigma_m / quality_half_sigma_m)^2), limited where the orientation is ambiguous.
    position_sigma_m, yaw_sigma_rad: standard deviations of the marker's position and of the board's yaw (about the
    dock's vertical; about the marker's own y for a marker of no dock).
    corners_px: (4, 2) as fitted, in OpenCV's order.
    """

    marker_id: int
    pose: Array
    quality: float
    ambiguous: bool
    position_sigma_m: float
    yaw_sigma_rad: float
    corners_px: Array


@dataclass(slots=True)
class _Track:
    """What the last images of one camera showed. sides_px: the smallest marker's side, px."""

    region: Region | None = None
    side_px: float = 0.0
    images: int = 0
    misses: int = 0
    rotations: dict[str, Array] = field(default_factory=dict)


class MarkerDetector:
    """Keeps, for each camera, the part of the image where its markers were, and their last orientation."""

    def __init__(self, docks: Docks, params: DetectorParams) -> None:
        """Raises ValueError for a dictionary that OpenCV does not know."""
        edges = params.edges
        self._params = params
        self._boards = Boards(docks)
        self._search = MarkerSearch(docks.dictionary, params.search)
        self._tracks: dict[str, _Track] = {}
        self._widths_px = np.array([edges.coarse_window_px, edges.fine_window_px, edges.fine_window_px])
        self._limits = np.array(
            [
                edges.min_contrast,
                edges.min_contrast_share,
                edges.min_samples_share,
                edges.end_share,
                edges.scatter_floor_px,
            ]
        )

    def reset(self) -> None:
        """Forgets all earlier images."""
        self._tracks.clear()

    def warm_up(self) -> None:
        """Compiles what is compiled at the first use, so that the first image is not late by seconds."""
        blank = np.zeros((64, 64), np.uint8)
        square = np.array([[[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]]])
        blank[:] = 255
        blank[20:44, 20:44] = 0
        camera = np.array([60.0, 60.0, 31.5, 31.5, 0.0, 0.0, 0.0, 0.0, 0.0])
        corners = undistort_points(camera, distort_points(camera, square[0])).reshape(1, 4, 2)
        sides = fit_sides(blank, camera, corners, self._widths_px, self._limits)
        board = self._boards.of(-1)
        seen = marker_sides(-1, board, sides[0], corners[0], 60.0, self._params.edges)
        if seen is not None:
            board_pose([seen], None, self._params.pose)

    def detect(self, image: Image, intrinsics: Intrinsics, camera_frame: str) -> tuple[MarkerObservation, ...]:
        """The markers in an image (height, width) of grey levels, in order of their ids.

        Raises ValueError, naming what is wrong, for an image or intrinsics that cannot be used.
        """
        _check(image, intrinsics)
        if not image.flags.carray:  # padded rows or read-only: compiled code is made for one kind of array (0.1 ms)
            image = image.copy()
        track = self._tracks.setdefault(camera_frame, _Track())
        found = self._find(image, track)
        camera = camera_vector(intrinsics)
        boards = {marker: self._boards.of(marker) for marker in found}
        observations: list[MarkerObservation] = []
        poses: dict[str, tuple[Board, BoardPose]] = {}
        seen = self._fit(image, camera, found, boards)
        for name, markers in group_by_board({marker: boards[marker] for marker in seen}).items():
            board = boards[markers[0]]
            pose = board_pose([seen[marker] for marker in markers], track.rotations.get(name), self._params.pose)
            if pose is not None:
                poses[name] = (board, pose)
                observations += [self._observation(seen[marker], board, pose, camera) for marker in pose.used]
        self._follow(image, track, camera, poses)
        return tuple(sorted(observations, key=lambda item: item.marker_id))

    def _find(self, image: Image, track: _Track) -> dict[int, Array]:
        """Corners by marker id: where the markers were, else, or from time to time, in the whole image."""
        search = self._params.search
        track.images += 1
        if track.region is not None and track.images % search.full_search_every != 0:
            shrink = int(min(max(track.side_px / search.shrunk_side_px, 1.0), _LARGEST_SHRINK))
            found = self._search.find(image, track.region, shrink, track.misses)
            if found:
                return found
        return self._search.find(image, whole(image), 1, track.misses)

    def _fit(
        self, image: Image, camera: Array, found: dict[int, Array], boards: dict[int, Board]
    ) -> dict[int, MarkerSides]:
        """The markers of which enough can be fitted."""
        if not found:
            return {}
        corners = undistort_points(camera, np.concatenate(list(found.values()))).reshape(-1, 4, 2)
        sides = fit_sides(image, camera, corners, self._widths_px, self._limits)
        fitted = {
            marker: marker_sides(marker, boards[marker], sides[i], corners[i], camera[0], self._params.edges)
            for i, marker in enumerate(found)
        }
        return {marker: item for marker, item in fitted.items() if item is not None}

    def _observation(self, seen: MarkerSides, board: Board, pose: BoardPose, camera: Array) -> MarkerObservation:
        place = board.places[seen.marker_id]
        sigma_m = pose.sigma_of(place[:3, 3])
        quality = 1.0 / (1.0 + (sigma_m / self._params.pose.quality_half_sigma_m) ** 2)
        if pose.ambiguous:
            quality = min(quality, self._params.pose.ambiguous_quality)
        return MarkerObservation(
            seen.marker_id,
            pose.matrix() @ place,
            quality,
            pose.ambiguous,
            sigma_m,
            pose.sigma_about(board.up),
            distort_points(camera, seen.corners),
        )

    def _follow(self, image: Image, track: _Track, camera: Array, poses: dict[str, tuple[Board, BoardPose]]) -> None:
        """Where to look in the next image: around all markers of the boards that were seen."""
        search = self._params.search
        if not poses:
            track.misses += 1
            track.region = None
            if track.misses >= search.forget_after:
                track.rotations.clear()
            return
        track.misses = 0
        quads = [
            _projected(corners, pose, camera) for board, pose in poses.values() for corners in board.corners.values()
        ]
        track.region = around(np.concatenate(quads), search.region_margin_share, search.region_margin_px, image)
        track.side_px = min(float(np.linalg.norm(quad - np.roll(quad, -1, axis=0), axis=1).min()) for quad in quads)
        track.rotations = {name: pose.rotation for name, (_, pose) in poses.items()}


def _projected(corners: Array, pose: BoardPose, camera: Array) -> Array:
    """(4, 2) px of (4, 3) corners in the board's frame; NaN behind the camera."""
    points = corners @ pose.rotation.T + pose.translation
    depth = np.where(points[:, 2:] > 1e-3, points[:, 2:], np.nan)
    pixels: Array = distort_points(camera, points[:, :2] / depth)
    return pixels


def _check(image: Image, intrinsics: Intrinsics) -> None:
    kind = getattr(image, "dtype", type(image).__name__)
    if kind != np.uint8:
        raise ValueError(f"image: must be an array of uint8, is {kind}")
    if image.shape != (intrinsics.height, intrinsics.width):
        raise ValueError(
            f"image: shape is {image.shape}, intrinsics say (height, width) = ({intrinsics.height}, {intrinsics.width})"
        )
    if not np.isfinite(camera_vector(intrinsics)).all():
        raise ValueError("intrinsics: must be finite")
    if not (intrinsics.fx > 0.0 and intrinsics.fy > 0.0):
        raise ValueError(f"intrinsics: focal lengths must be positive, are {intrinsics.fx} and {intrinsics.fy}")

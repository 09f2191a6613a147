"""The marker detector: computes poses of markers from an image."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.camera import Intrinsics
from robot_stack.core.docks import Docks
from robot_stack.docking.vision.board import Board, Boards, gauss_points
from robot_stack.docking.vision.edges import camera_vector, distort_points, fit_sides, undistort_points
from robot_stack.docking.vision.params import DetectorParams
from robot_stack.docking.vision.pose import STILL, BoardPose, board_pose, refined_pose, twist_between
from robot_stack.docking.vision.search import MarkerSearch, Region, around, whole
from robot_stack.docking.vision.sides import MarkerSides, marker_sides

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


@dataclass(frozen=True, slots=True)
class _Known:
    """A board in the last image that showed it. stamp_s: None if the image had none. twist: (6,) rad/s, m/s."""

    board: Board
    pose: BoardPose
    stamp_s: float | None
    twist: Array


@dataclass(slots=True)
class _Track:
    """State from the last images of one camera. sides_px: the smallest marker's side, px."""

    region: Region | None = None
    side_px: float = 0.0
    images: int = 0
    misses: int = 0
    known: dict[str, _Known] = field(default_factory=dict)


class MarkerDetector:
    """Keeps, for each camera, the part of the image where its markers were, and their last orientation."""

    def __init__(self, docks: Docks, params: DetectorParams) -> None:
        """Raises ValueError for a dictionary that OpenCV does not have."""
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
        """Clears the state of all earlier images."""
        self._tracks.clear()

    def warm_up(self) -> None:
        """Compiles functions before their first use, so that the first image is not delayed by seconds."""
        blank = np.zeros((64, 64), np.uint8)
        square = np.array([[[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]]])
        blank[:] = 255
        blank[20:44, 20:44] = 0
        camera = np.array([60.0, 60.0, 31.5, 31.5, 0.0, 0.0, 0.0, 0.0, 0.0])
        corners = undistort_points(camera, distort_points(camera, square[0])).reshape(1, 4, 2)
        sides = fit_sides(blank, camera, corners, self._widths_px, self._limits)
        board = self._boards.of(-1)
        seen = marker_sides(-1, board, sides[0], corners[0], np.zeros(8), 60.0, self._params.edges)
        if seen is not None:
            board_pose([seen], None, STILL, self._params.pose)

    def detect(
        self, image: Image, intrinsics: Intrinsics, camera_frame: str, stamp_s: float | None = None
    ) -> tuple[MarkerObservation, ...]:
        """The markers in an image (height, width) of grey levels, in order of their ids.

        stamp_s: time of the middle row's exposure. It gives the motion since the last image, with which rolling
        shutter is corrected; poses are those at the stamp.
        Raises ValueError, naming the error, for an invalid image or invalid intrinsics.
        """
        _check(image, intrinsics, stamp_s)
        if not image.flags.carray:  # padded rows or read-only: compiled code is made for one kind of array (0.1 ms)
            image = image.copy()
        track = self._tracks.setdefault(camera_frame, _Track())
        camera = camera_vector(intrinsics)
        found = self._find(image, track)
        boards = {marker: self._boards.of(marker) for marker in found}
        seen = self._fit(image, camera, found, boards)
        observations: list[MarkerObservation] = []
        known: dict[str, _Known] = {}
        for board in {boards[marker].name: boards[marker] for marker in seen}.values():
            markers = [item for marker, item in seen.items() if marker in board.corners]
            now = self._solve(board, markers, track.known.get(board.name), stamp_s)
            if now is not None:
                known[board.name] = now
                observations += [self._observation(seen[marker], board, now.pose, camera) for marker in now.pose.used]
        self._follow(image, track, camera, known)
        return tuple(sorted(observations, key=lambda item: item.marker_id))

    def _solve(
        self, board: Board, markers: list[MarkerSides], last: _Known | None, stamp_s: float | None
    ) -> _Known | None:
        """The pose of a board, with its motion since the last image undone."""
        shutter, params = self._params.shutter, self._params.pose
        twist = STILL if last is None else last.twist
        pose = board_pose(markers, None if last is None else last.pose.rotation, twist, params)
        if pose is None:
            return None
        if last is None or stamp_s is None or last.stamp_s is None or shutter.row_time_s == 0.0:
            return _Known(board, pose, stamp_s, STILL)
        gap_s = stamp_s - last.stamp_s
        twist = twist_between(last.pose, pose, gap_s) if 0.0 < gap_s <= shutter.longest_gap_s else STILL
        if np.linalg.norm(twist[:3]) > shutter.fastest_radps or np.linalg.norm(twist[3:]) > shutter.fastest_mps:
            twist = STILL
        better = refined_pose(pose, markers, twist, params)
        return _Known(board, better or pose, stamp_s, twist)

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
        seen: dict[int, MarkerSides] = {}
        for i, marker in enumerate(found):
            late_s = self._late_s(corners[i], camera, image.shape[0])
            item = marker_sides(marker, boards[marker], sides[i], corners[i], late_s, camera[0], self._params.edges)
            if item is not None:
                seen[marker] = item
        return seen

    def _late_s(self, corners: Array, camera: Array, rows: int) -> Array:
        """(8,) how much later than the middle row the Gauss points of a marker's sides are exposed, s."""
        pixels = distort_points(camera, gauss_points(corners))
        late_s: Array = (pixels[:, 1] - 0.5 * (rows - 1)) * self._params.shutter.row_time_s
        return late_s

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

    def _follow(self, image: Image, track: _Track, camera: Array, known: dict[str, _Known]) -> None:
        """The search region of the next image: around all markers of the detected boards."""
        search = self._params.search
        if not known:
            track.misses += 1
            track.region = None
            if track.misses >= search.forget_after:
                track.known.clear()
            return
        track.misses = 0
        quads = [
            _projected(corners, item.pose, camera) for item in known.values() for corners in item.board.corners.values()
        ]
        track.region = around(np.concatenate(quads), search.region_margin_share, search.region_margin_px, image)
        track.side_px = min(float(np.linalg.norm(quad - np.roll(quad, -1, axis=0), axis=1).min()) for quad in quads)
        track.known = known


def _projected(corners: Array, pose: BoardPose, camera: Array) -> Array:
    """(4, 2) px of (4, 3) corners in the board's frame; NaN behind the camera."""
    points = corners @ pose.rotation.T + pose.translation
    depth = np.where(points[:, 2:] > 1e-3, points[:, 2:], np.nan)
    pixels: Array = distort_points(camera, points[:, :2] / depth)
    return pixels


def _check(image: Image, intrinsics: Intrinsics, stamp_s: float | None) -> None:
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
    if stamp_s is not None and not np.isfinite(stamp_s):
        raise ValueError(f"stamp_s: must be finite, is {stamp_s}")

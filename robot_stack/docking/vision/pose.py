"""Pose of a board from the fitted sides of its visible markers.

A square seen from far away looks the same from two sides (the two solutions of a plane's pose, IPPE): both are refined
and compared. Markers that contradict the others are left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.docking.vision.board import Board, gauss_points
from robot_stack.docking.vision.edges import COUNT, NX, SCATTER, C
from robot_stack.docking.vision.params import EdgeParams, PoseParams
from robot_stack.docking.vision.solve import residuals, solve

Array = NDArray[np.float64]

_FLAT_M = 1e-6
# Two refined poses that turn by less are one; markers are hardly seen at all at more than 85 deg.
_SAME_POSE_RAD = 0.01


@dataclass(frozen=True, slots=True)
class MarkerSides:
    """One marker as seen: (n, 3) model points with (n, 3) lines and (n,) weights, and (4, 3) / (4, 2) corners."""

    marker_id: int
    points: Array
    lines: Array
    weights: Array
    model_corners: Array
    corners: Array


@dataclass(frozen=True, slots=True)
class BoardPose:
    """Board in the camera frame: x_camera = rotation x_board + translation.

    covariance: (6, 6) of a rotation (rad, camera axes, about the board's origin) and of the translation (m).
    used: markers that the pose was computed from.
    """

    rotation: Array
    translation: Array
    covariance: Array
    ambiguous: bool
    used: tuple[int, ...]

    def matrix(self) -> Array:
        """(4, 4)"""
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = self.rotation, self.translation
        return pose

    def sigma_of(self, place: Array) -> float:
        """Standard deviation (m) of the position of a point (3,) of the board: root of the summed variances."""
        q = self.rotation @ place
        jacobian = np.c_[np.array([[0.0, q[2], -q[1]], [-q[2], 0.0, q[0]], [q[1], -q[0], 0.0]]), np.eye(3)]
        return math.sqrt(max(float(np.trace(jacobian @ self.covariance @ jacobian.T)), 0.0))

    def sigma_about(self, axis: Array) -> float:
        """Standard deviation (rad) of the rotation about an axis (3,) of the board."""
        a = self.rotation @ axis
        return math.sqrt(max(float(a @ self.covariance[:3, :3] @ a), 0.0))


@dataclass(frozen=True, slots=True)
class _Refined:
    rotation: Array
    translation: Array
    cost: float
    information: Array


def marker_sides(
    marker_id: int, board: Board, sides: Array, corners: Array, focal_px: float, params: EdgeParams
) -> MarkerSides | None:
    """A marker's (4, 5) of :func:`fit_sides` and (4, 2) corners as input of a pose; None with less than 3 sides."""
    good = sides[:, COUNT] > 0.0
    if good.sum() < 3 or not np.isfinite(corners).all():
        return None
    variance = 2.0 * sides[good, SCATTER] ** 2 / sides[good, COUNT] + (params.systematic_px / focal_px) ** 2
    points = gauss_points(board.corners[marker_id])
    return MarkerSides(
        marker_id,
        np.ascontiguousarray(points[np.repeat(good, 2)]),
        np.repeat(sides[good][:, NX : C + 1], 2, axis=0),
        np.repeat(1.0 / np.sqrt(variance), 2),
        board.corners[marker_id],
        corners,
    )


def board_pose(markers: Sequence[MarkerSides], previous: Array | None, params: PoseParams) -> BoardPose | None:
    """The pose that fits all markers but those which contradict the others; None if there is none.

    previous: (3, 3) rotation in the last image, which decides between two equally good ones.
    """
    kept = list(markers)
    solutions = _solutions(kept)
    while len(kept) > 1 and solutions and _contradicted(solutions[0], kept, params):
        options = [(marker, _solutions([other for other in kept if other is not marker])) for marker in kept]
        options = [option for option in options if option[1]]
        if not options:
            break
        worst, remaining = min(options, key=lambda option: option[1][0].cost)
        rest = [marker for marker in kept if marker is not worst]
        if _mean_square(remaining[0], rest) * params.outlier_gain > _mean_square(solutions[0], kept):
            break
        kept, solutions = rest, remaining
    return _judged(kept, solutions, previous, params) if solutions else None


def _judged(
    kept: Sequence[MarkerSides], solutions: Sequence[_Refined], previous: Array | None, params: PoseParams
) -> BoardPose | None:
    best = solutions[0]
    scale = max(1.0, _mean_square(best, kept))
    rivals = [other for other in solutions[1:] if (other.cost - best.cost) / scale < params.ambiguous_cost]
    if rivals and previous is not None:
        best = min([best, *rivals], key=lambda item: _angle(item.rotation, previous))
    try:
        covariance: Array = np.linalg.inv(best.information).astype(np.float64) * scale
    except np.linalg.LinAlgError:
        return None
    if not np.isfinite(covariance).all():
        return None
    vague = float(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1])) > params.ambiguous_sigma_rad
    used = tuple(marker.marker_id for marker in kept)
    return BoardPose(best.rotation, best.translation, covariance, bool(rivals) or vague, used)


def _solutions(markers: Sequence[MarkerSides]) -> list[_Refined]:
    """The distinct refined poses, best first."""
    points, lines, weights = (
        np.concatenate([getattr(marker, name) for marker in markers]) for name in ("points", "lines", "weights")
    )
    found: list[_Refined] = []
    for rotation, translation in _starts(markers):
        refined = _Refined(*solve(points, lines, weights, rotation, translation))
        if np.isfinite(refined.cost) and np.isfinite(refined.translation).all() and _faces(refined, markers[0]):
            found.append(refined)
    found.sort(key=lambda item: item.cost)
    return [item for i, item in enumerate(found) if i == 0 or _angle(item.rotation, found[0].rotation) > _SAME_POSE_RAD]


def _starts(markers: Sequence[MarkerSides]) -> list[tuple[Array, Array]]:
    """Poses from the corners alone: both solutions of IPPE for markers in one plane, else SQPnP's."""
    model = np.concatenate([marker.model_corners for marker in markers])
    seen = np.concatenate([marker.corners for marker in markers])
    first = markers[0].model_corners
    x, y = first[1] - first[0], first[0] - first[3]
    axes = np.stack([x / np.linalg.norm(x), y / np.linalg.norm(y), np.cross(x, y) / np.linalg.norm(np.cross(x, y))])
    middle = model.mean(axis=0)
    flat = (model - middle) @ axes.T
    method = cv2.SOLVEPNP_IPPE if np.abs(flat[:, 2]).max() < _FLAT_M else cv2.SOLVEPNP_SQPNP
    try:
        _, turns, shifts, _ = cv2.solvePnPGeneric(flat, seen, np.eye(3), None, flags=method)
    except cv2.error:  # degenerate corners
        return []
    starts = []
    for turn, shift in zip(turns, shifts, strict=True):
        rotation = np.ascontiguousarray(cv2.Rodrigues(turn)[0] @ axes)
        translation = shift.ravel() - rotation @ middle
        if np.isfinite(rotation).all() and np.isfinite(translation).all():
            starts.append((rotation, translation))
    return starts


def _faces(pose: _Refined, marker: MarkerSides) -> bool:
    """True if the camera looks at the marker's printed side."""
    corners = marker.model_corners
    normal = pose.rotation @ np.cross(corners[1] - corners[0], corners[0] - corners[3])
    middle = pose.rotation @ corners.mean(axis=0) + pose.translation
    return bool(normal @ middle < 0.0)


def _contradicted(pose: _Refined, markers: Sequence[MarkerSides], params: PoseParams) -> bool:
    """True if some marker lies where this pose does not put it."""
    return any(_mean_square(pose, [marker]) > params.outlier_sigmas**2 for marker in markers)


def _mean_square(pose: _Refined, markers: Sequence[MarkerSides]) -> float:
    """Squared error in variances; for a whole pose divided by its degrees of freedom."""
    errors = np.concatenate([residuals(m.points, m.lines, m.weights, pose.rotation, pose.translation) for m in markers])
    return float(errors @ errors / max(len(errors) - (6 if len(errors) > 6 else 0), 1))


def _angle(a: Array, b: Array) -> float:
    """Angle (rad) between two rotations."""
    return float(np.arccos(np.clip(0.5 * (np.trace(a.T @ b) - 1.0), -1.0, 1.0)))


def group_by_board(boards: Mapping[int, Board]) -> dict[str, list[int]]:
    """Marker ids by the name of their board, both in order."""
    groups: dict[str, list[int]] = {}
    for marker in sorted(boards):
        groups.setdefault(boards[marker].name, []).append(marker)
    return groups

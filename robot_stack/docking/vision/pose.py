"""Pose of a board from the fitted sides of its visible markers.

A square seen from far away looks the same from two sides (the two solutions of a plane's pose, IPPE): both are refined
and compared. Markers, and single sides, that contradict the others are left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.docking.vision.params import PoseParams
from robot_stack.docking.vision.sides import MarkerSides, start_poses
from robot_stack.docking.vision.solve import residuals, solve

Array = NDArray[np.float64]

STILL = np.zeros(6)
"""The twist of a board that does not move in the camera frame."""

# Two refined poses that turn by less are one.
_SAME_POSE_RAD = 0.01
# Rows of equations that must be left when sides are dropped: four more than unknowns.
_LEAST_ROWS = 10


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
class _Rows:
    """The equations of several markers."""

    points: Array
    lines: Array
    weights: Array
    late_s: Array
    twist: Array

    @classmethod
    def of(cls, markers: Sequence[MarkerSides], twist: Array) -> _Rows:
        points, lines, weights, late_s = (
            np.concatenate([getattr(marker, name) for marker in markers])
            for name in ("points", "lines", "weights", "late_s")
        )
        return cls(points, lines, weights, late_s, twist)

    def errors(self, pose: _Refined) -> Array:
        """(n,) in standard deviations."""
        found: Array = residuals(
            self.points, self.lines, self.weights, self.late_s, self.twist, pose.rotation, pose.translation
        )
        return found

    def refine(self, rotation: Array, translation: Array) -> _Refined:
        return _Refined(*solve(self.points, self.lines, self.weights, self.late_s, self.twist, rotation, translation))

    def without(self, dropped: NDArray[np.bool_]) -> _Rows:
        return replace(self, weights=np.where(dropped, 0.0, self.weights))


@dataclass(frozen=True, slots=True)
class _Refined:
    rotation: Array
    translation: Array
    cost: float
    information: Array


def board_pose(
    markers: Sequence[MarkerSides], previous: Array | None, twist: Array, params: PoseParams
) -> BoardPose | None:
    """The pose that fits all markers but those which contradict the others; None if there is none.

    previous: (3, 3) rotation in the last image, which decides between two equally good ones. twist: (6,) of the board
    in the camera frame, rad/s and m/s.
    """
    kept = list(markers)
    solutions = _solutions(kept, twist)
    while len(kept) > 1 and solutions and _contradicted(solutions[0], kept, twist, params):
        options = [(marker, _solutions([other for other in kept if other is not marker], twist)) for marker in kept]
        options = [option for option in options if option[1]]
        if not options:
            break
        worst, remaining = min(options, key=lambda option: option[1][0].cost)
        rest = [marker for marker in kept if marker is not worst]
        if _mean_square(remaining[0], rest, twist) * params.outlier_gain > _mean_square(solutions[0], kept, twist):
            break
        kept, solutions = rest, remaining
    return _judged(kept, solutions, previous, twist, params) if solutions else None


def refined_pose(pose: BoardPose, markers: Sequence[MarkerSides], twist: Array, params: PoseParams) -> BoardPose | None:
    """A pose again, from the markers it used, with a better known twist."""
    kept = [marker for marker in markers if marker.marker_id in pose.used]
    rows = _Rows.of(kept, twist)
    return _finished(rows, rows.refine(pose.rotation, pose.translation), pose.ambiguous, pose.used, params)


def twist_between(first: BoardPose, second: BoardPose, gap_s: float) -> Array:
    """(6,) mean twist of the board in the camera frame, rad/s and m/s."""
    turn, _ = cv2.Rodrigues(second.rotation @ first.rotation.T)
    rate = turn.ravel() / gap_s
    middle = 0.5 * (first.translation + second.translation)
    speed = (second.translation - first.translation) / gap_s - np.cross(rate, middle)
    return np.concatenate([rate, speed])


def _judged(
    kept: Sequence[MarkerSides], solutions: Sequence[_Refined], previous: Array | None, twist: Array, params: PoseParams
) -> BoardPose | None:
    best = solutions[0]
    scale = max(1.0, _mean_square(best, kept, twist))
    rivals = [other for other in solutions[1:] if (other.cost - best.cost) / scale < params.ambiguous_cost]
    if rivals and previous is not None:
        best = min([best, *rivals], key=lambda item: _angle(item.rotation, previous))
    used = tuple(marker.marker_id for marker in kept)
    return _finished(_Rows.of(kept, twist), best, bool(rivals), used, params)


def _finished(
    rows: _Rows, best: _Refined, ambiguous: bool, used: tuple[int, ...], params: PoseParams
) -> BoardPose | None:
    """Leaves out sides that contradict, and gives the covariance."""
    best, rows = _without_bad_sides(rows, best, params)
    if not math.isfinite(best.cost):
        return None
    errors = rows.errors(best)
    freedom = max(int((rows.weights > 0.0).sum()) - 6, 1)
    try:
        covariance: Array = np.linalg.inv(best.information).astype(np.float64) * max(
            1.0, float(errors @ errors) / freedom
        )
    except np.linalg.LinAlgError:
        return None
    if not (np.isfinite(covariance).all() and np.isfinite(best.translation).all()):
        return None
    vague = math.sqrt(float(np.linalg.eigvalsh(covariance[:3, :3])[-1])) > params.ambiguous_sigma_rad
    return BoardPose(best.rotation, best.translation, covariance, ambiguous or vague, used)


def _without_bad_sides(rows: _Rows, best: _Refined, params: PoseParams) -> tuple[_Refined, _Rows]:
    """Drops the sides far from where the rest puts them, by the scatter of all, while enough are left."""
    for _ in range(3):
        errors = np.abs(rows.errors(best)).reshape(-1, 2).max(axis=1)
        limit = params.outlier_sigmas * max(1.0, 1.4826 * float(np.median(errors)))
        bad = np.repeat((errors > limit) | (rows.weights[::2] == 0.0), 2)
        if bad.sum() == (rows.weights == 0.0).sum() or len(bad) - bad.sum() < _LEAST_ROWS:
            break
        rows = rows.without(bad)
        best = rows.refine(best.rotation, best.translation)
    return best, rows


def _solutions(markers: Sequence[MarkerSides], twist: Array) -> list[_Refined]:
    """The distinct refined poses, best first."""
    rows = _Rows.of(markers, twist)
    refined = [rows.refine(rotation, translation) for rotation, translation in start_poses(markers)]
    found = [item for item in refined if math.isfinite(item.cost) and _faces(item, markers[0])]
    found.sort(key=lambda item: item.cost)
    return [item for i, item in enumerate(found) if i == 0 or _angle(item.rotation, found[0].rotation) > _SAME_POSE_RAD]


def _faces(pose: _Refined, marker: MarkerSides) -> bool:
    """True if the camera looks at the marker's printed side."""
    corners = marker.model_corners
    normal = pose.rotation @ np.cross(corners[1] - corners[0], corners[0] - corners[3])
    middle = pose.rotation @ corners.mean(axis=0) + pose.translation
    return bool(normal @ middle < 0.0)


def _contradicted(pose: _Refined, markers: Sequence[MarkerSides], twist: Array, params: PoseParams) -> bool:
    """True if some marker lies where this pose does not put it."""
    return any(_mean_square(pose, [marker], twist) > params.outlier_sigmas**2 for marker in markers)


def _mean_square(pose: _Refined, markers: Sequence[MarkerSides], twist: Array) -> float:
    """Squared error in variances; of several markers divided by its degrees of freedom."""
    errors = _Rows.of(markers, twist).errors(pose)
    return float(errors @ errors / max(len(errors) - (6 if len(markers) > 1 else 0), 1))


def _angle(a: Array, b: Array) -> float:
    """Angle (rad) between two rotations."""
    return math.acos(min(max(0.5 * (float(np.trace(a.T @ b)) - 1.0), -1.0), 1.0))

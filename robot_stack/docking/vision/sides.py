"""One marker's fitted sides as equations of a pose, and where such a pose may begin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.docking.vision.board import Board, gauss_points
from robot_stack.docking.vision.edges import COUNT, NX, SCATTER, C
from robot_stack.docking.vision.params import EdgeParams

Array = NDArray[np.float64]

_FLAT_M = 1e-6
# A second solution this much worse than the first, from the corners alone, is not worth refining: normalised, share.
_CLEARLY_WORSE, _CLEARLY_WORSE_SHARE = 1e-3, 10.0


@dataclass(frozen=True, slots=True)
class MarkerSides:
    """One marker as seen.

    points: (n, 3) of the model, that must lie on the (n, 3) lines, with weights (n,) and (n,) seconds that their image
    rows are late. model_corners, corners: (4, 3) and (4, 2) normalised.
    """

    marker_id: int
    points: Array
    lines: Array
    weights: Array
    late_s: Array
    model_corners: Array
    corners: Array


def marker_sides(
    marker_id: int, board: Board, sides: Array, corners: Array, late_s: Array, focal_px: float, params: EdgeParams
) -> MarkerSides | None:
    """A marker's (4, 5) of :func:`fit_sides` and (4, 2) corners as input of a pose; None with less than 3 sides.

    late_s: (8,) of the two Gauss points of each side.
    """
    good = sides[:, COUNT] > 0.0
    if good.sum() < 3 or not np.isfinite(corners).all():
        return None
    variance = 2.0 * sides[good, SCATTER] ** 2 / sides[good, COUNT] + (params.systematic_px / focal_px) ** 2
    points = gauss_points(board.corners[marker_id])
    rows = np.repeat(good, 2)
    return MarkerSides(
        marker_id,
        np.ascontiguousarray(points[rows]),
        np.repeat(sides[good][:, NX : C + 1], 2, axis=0),
        np.repeat(1.0 / np.sqrt(variance), 2),
        late_s[rows],
        board.corners[marker_id],
        corners,
    )


def start_poses(markers: Sequence[MarkerSides]) -> list[tuple[Array, Array]]:
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
        _, turns, shifts, errors = cv2.solvePnPGeneric(flat, seen, np.eye(3), None, flags=method)
    except cv2.error:  # degenerate corners
        return []
    starts: list[tuple[Array, Array]] = []
    for turn, shift, error in zip(turns, shifts, np.ravel(errors), strict=True):
        if starts and error > max(_CLEARLY_WORSE, _CLEARLY_WORSE_SHARE * float(np.ravel(errors)[0])):
            continue
        rotation = np.ascontiguousarray(cv2.Rodrigues(turn)[0] @ axes)
        translation = shift.ravel() - rotation @ middle
        if np.isfinite(rotation).all() and np.isfinite(translation).all():
            starts.append((rotation, translation))
    return starts

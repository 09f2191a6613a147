"""Mounting of a camera, from a ride before markers that stand still: its motion compared with that of the LiDAR.

The camera measures base_link's motion relative to the markers, the LiDAR relative to everything else; both agree only
with the right mounting (hand-eye calibration, Tsai and Lenz, 1989; here as one least-squares problem over all views).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from robot_stack.mapping.params import CameraMount as Settings
from robot_stack.mapping.poses import Floats, inverse, rotation_of, vector_of, yaw_of
from robot_stack.mapping.ride import RideError

# Deviations between LiDAR and camera: 2 mm, and in the camera's frame half a mrad except for the board's yaw, which few
# markers measure worse. If they were estimated from the residuals, one of the six would take all the weight.
_SPREAD = np.array([2e-3, 2e-3, 2e-3, 5e-4, 2e-3, 5e-4])
_OUTLIER = 3.0  # deviations beyond which a view counts less
_GROUPS = 10  # of consecutive views, whose errors may be correlated
_ANGLES, _PLACE = slice(0, 3), slice(3, 5)
_UNKNOWN = 11  # the camera pose without its height, and the board pose


@dataclass(frozen=True, slots=True)
class CameraMountFound:
    """pose: (4, 4) optical frame in base_link. angle_deviation_rad: (3,) about base_link's axes; place_deviation_m:
    (2,) x, y. residuals: (n, 6) from the measured board to the one expected by the LiDAR, in the camera: m, rad.
    """

    pose: Floats
    angle_deviation_rad: Floats
    place_deviation_m: Floats
    residuals: Floats


def camera_mount_of(base: Floats, seen: Floats, nominal: Floats, settings: Settings) -> CameraMountFound:
    """base: (n, 4, 4) base_link in a frame that stands still, by the LiDAR. seen: (n, 4, 4) board in the camera at the
    same moments. nominal: (4, 4) assumed pose of the camera in base_link.

    The camera's height is not observable on a plane and stays nominal.
    Raises RideError naming what the views do not determine.
    """
    if len(base) < settings.fewest_views:
        raise RideError(f"only {len(base)} views of the board, at least {settings.fewest_views} are needed")
    turn_deg = math.degrees(float(np.ptp(np.unwrap(yaw_of(base)))))
    if turn_deg < settings.least_turn_deg:
        raise RideError(
            f"the robot turned by only {turn_deg:.0f} deg with the board in view, at least "
            f"{settings.least_turn_deg:g} deg are needed: turn left and right in front of the board"
        )
    board = base[0] @ nominal @ seen[0]

    unknown = _fitted(base, seen, nominal, board)
    residuals = _residuals(unknown, base, seen, nominal, board)
    deviation = _deviation(base, seen, nominal, board)
    result = CameraMountFound(_mounted(nominal, unknown), deviation[_ANGLES], deviation[_PLACE], residuals)
    _check(result, settings)
    return result


def _residuals(unknown: Floats, base: Floats, seen: Floats, nominal: Floats, board: Floats) -> Floats:
    """(n, 6)"""
    camera, place = _mounted(nominal, unknown), _nudged(board, unknown[5:])
    expected = inverse(base @ camera) @ place
    shift = expected[:, :3, 3] - seen[:, :3, 3]
    turn = vector_of(np.swapaxes(seen[:, :3, :3], 1, 2) @ expected[:, :3, :3])
    rows: Floats = np.concatenate([shift, turn], axis=1)
    return rows


def _fitted(base: Floats, seen: Floats, nominal: Floats, board: Floats) -> Floats:
    """(11,) unknowns."""

    def weighed(unknown: Floats) -> Floats:
        rows: Floats = _residuals(unknown, base, seen, nominal, board) / _SPREAD
        return rows.ravel()

    found: Floats = least_squares(weighed, np.zeros(_UNKNOWN), loss="soft_l1", f_scale=_OUTLIER).x
    return found


def _deviation(base: Floats, seen: Floats, nominal: Floats, board: Floats) -> Floats:
    """(11,) of the unknowns, by leaving out one group of views after the other (jackknife): errors of consecutive
    views are correlated, which a deviation from the size of the residuals would miss.
    """
    groups = np.array_split(np.arange(len(base)), _GROUPS)
    kept = [np.setdiff1d(np.arange(len(base)), group) for group in groups]
    found = np.array([_fitted(base[rest], seen[rest], nominal, board) for rest in kept])
    deviation: Floats = np.sqrt((_GROUPS - 1) / _GROUPS * ((found - found.mean(axis=0)) ** 2).sum(axis=0))
    return deviation


def _mounted(nominal: Floats, unknown: Floats) -> Floats:
    """Rotated in place about base_link's axes, then moved in x and y."""
    pose = nominal.copy()
    pose[:3, :3] = rotation_of(unknown[_ANGLES]) @ nominal[:3, :3]
    pose[:2, 3] += unknown[_PLACE]
    return pose


def _nudged(pose: Floats, unknown: Floats) -> Floats:
    result = pose.copy()
    result[:3, :3] = rotation_of(unknown[:3]) @ pose[:3, :3]
    result[:3, 3] += unknown[3:]
    return result


def _check(found: CameraMountFound, settings: Settings) -> None:
    angle_deg = math.degrees(float(found.angle_deviation_rad.max()))
    if not angle_deg <= settings.deviation_deg:
        raise RideError(
            f"the deviation of the angles is {angle_deg:.2f} deg, at most {settings.deviation_deg:g} deg is allowed: "
            "drive farther back and forth and sideways in front of the board, for longer"
        )
    place_m = float(found.place_deviation_m.max())
    if not place_m <= settings.deviation_m:
        raise RideError(
            f"the deviation of the position is {1e3 * place_m:.1f} mm, at most {1e3 * settings.deviation_m:g} mm is "
            "allowed: turn farther to both sides in front of the board, for longer"
        )

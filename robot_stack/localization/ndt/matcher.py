"""Registration of a subsampled sweep against a map, coarse to fine, with score, covariance and diagnostics."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import Pose2
from robot_stack.core.site_map import Cells
from robot_stack.localization.ndt import kernels, scoring
from robot_stack.localization.ndt.field import Field, field_of, merged, structure_of
from robot_stack.localization.ndt.params import MatchParams
from robot_stack.localization.ndt.skyline import Skyline

Floats = npt.NDArray[np.float64]

# Accuracy of a cell's normal, rad; its square is the share of the information that leaks into other directions.
_NORMAL_RAD = 0.05
_DIRECTIONS = 8


@dataclass(frozen=True, slots=True)
class Match:
    """The result of a match.

    pose: (4, 4) base_link in map. covariance: (6, 6) of [translation m, rotation rad] in the axes of map; 1 m and more
    in unconstrained directions. score: share of the points above the ground that the map explains, 0 with fewer than
    one. structure: how many such points. converged: the last, finest level did. reversals: steps of it that went back
    against the one before: the search oscillates between two solutions. residual: mean squared distance of explained
    points across their surfaces, in variances; about 1 at the right place, 3 for points near a surface by chance, NaN
    without any. agreement: like score, only of the points in columns where the map is not empty. contrast, pierced: see
    :meth:`NdtMatcher.weighed`, NaN if not computed.
    """

    pose: Floats
    covariance: Floats
    score: float
    structure: int
    converged: bool
    iterations: int
    reversals: int
    residual: float = math.nan
    agreement: float = math.nan
    contrast: float = math.nan
    pierced: float = math.nan

    @property
    def planar(self) -> Pose2:
        return planar(self.pose)

    @property
    def planar_covariance(self) -> Floats:
        """(3, 3) of x, y, yaw, m2, m rad, rad2."""
        rows = [0, 1, 5]
        return self.covariance[np.ix_(rows, rows)]

    @property
    def position_variances_m2(self) -> tuple[float, float]:
        """In the best and in the worst constrained direction."""
        best, worst = np.linalg.eigvalsh(self.planar_covariance[:2, :2])
        return float(best), float(worst)

    @property
    def tilt_rad(self) -> float:
        return math.acos(max(-1.0, min(1.0, float(self.pose[2, 2]))))


def planar(pose: Floats) -> Pose2:
    """x, y and yaw of a (4, 4) pose."""
    return Pose2(float(pose[0, 3]), float(pose[1, 3]), math.atan2(float(pose[1, 0]), float(pose[0, 0])))


def pose_of(planar_pose: Pose2, z_m: float, up: Floats) -> Floats:
    """(4, 4) pose with a yaw, and roll and pitch so that ``up`` (3,), the vertical in base_link, is upright in map."""
    pose = np.eye(4)
    roll, pitch = math.atan2(up[1], up[2]), math.atan2(-up[0], math.hypot(up[1], up[2]))
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(planar_pose.yaw), math.sin(planar_pose.yaw)
    pose[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    pose[:3, 3] = planar_pose.x, planar_pose.y, z_m
    return pose


class NdtMatcher:
    """Matches against one map. Holds no state between matches, so several threads may use one.

    Raises ValueError for a map without usable cells.
    """

    def __init__(self, cells: Cells, params: MatchParams) -> None:
        self._params = params
        structure = structure_of(cells, params.structure_height_m)
        self.levels: list[Field] = [
            field_of(merged(structure if it.structure else cells, it.cell_m), params.min_cell_points, it.blur_m)
            for it in params.levels
        ]
        self.skyline = Skyline(structure, params.min_cell_points)
        self._mixture = [_mixture(field.size_m, params.outlier_share) for field in self.levels]

    @property
    def fine(self) -> Field:
        return self.levels[-1]

    @property
    def wide(self) -> Field:
        """The level that a search correlates with: the coarsest but one."""
        return self.levels[min(1, len(self.levels) - 1)]

    def standing(self, points: Floats, up: Floats) -> Floats:
        """The points (n, 3) above the ground on which base_link stands."""
        return np.ascontiguousarray(points[points @ up > self._params.structure_height_m])

    def ground_m(self, x_m: float, y_m: float) -> float:
        """Height of the ground in the map, NaN where it is unknown."""
        field = self.fine
        ix = math.floor(x_m / field.size_m) - int(field.corner[0])
        iy = math.floor(y_m / field.size_m) - int(field.corner[1])
        inside = 0 <= ix < field.ground.shape[0] and 0 <= iy < field.ground.shape[1]
        return float(field.ground[ix, iy]) if inside else math.nan

    def match(self, points: Floats, guess: Floats, up: Floats, off_m: float) -> Match:
        """points: (n, 3) in base_link. guess: (4, 4), perhaps off_m off. up: (3,) vertical in base_link.

        Raises ValueError for points, a guess or a vertical that are not finite or of another shape.
        """
        _check(points, guess, up)
        rotation, position = np.ascontiguousarray(guess[:3, :3]), np.ascontiguousarray(guess[:3, 3])
        p, iterations, converged, reversals = self._params, 0, False, 0
        first = max((i for i, level in enumerate(p.levels) if level.reach_m >= off_m), default=0)
        standing = self.standing(points, guess[2, :3])
        for level, field, (d1, d2) in list(zip(p.levels, self.levels, self._mixture, strict=True))[first:]:
            loose = 1.0 if field is self.fine else 10.0  # a coarse level needs less precision
            prior = np.array([*up, 1.0 / p.tilt_sigma_rad**2, guess[2, 3], level.structure / p.height_sigma_m**2])
            limits = np.array(
                [p.max_iterations, p.max_step_m, p.max_turn_rad, loose * p.converged_m, loose * p.converged_rad]
            )
            _, steps, converged, reversals = kernels.newton(
                standing if level.structure else points, rotation, position, field, d1, d2, prior, limits
            )
            iterations += steps
        return self._judged(points, rotation, position, bool(converged), iterations, int(reversals))

    def weighed(self, points: Floats, match: Match, lidar: Floats) -> Match:
        """``match`` with further evidence, for the gate to evaluate at a low score.

        points: the matched points. lidar: (3,) sensor in base_link. contrast: ratio of the structure that the match
        explains to that of the best pose beside it, in eight directions and turned to both sides. pierced: share of the
        rays that pass through an occupied cell of the map. Neither with too few points. covariance: larger along the
        direction held worst, if poses along it explain nearly as much: posts in a row hold any of several poses.
        """
        p = self._params.beside
        standing = self.standing(points, match.pose[2, :3])
        if len(standing) < p.min_points:
            return match
        chosen = np.linspace(0, len(standing) - 1, min(len(standing), p.points)).astype(np.intp)
        few = np.ascontiguousarray(standing[chosen])
        beside, along = self._beside(match), self._along(match)
        poses = np.array([match.pose, *beside, *along])
        found = np.empty(len(poses))
        rotations, positions = np.ascontiguousarray(poses[:, :3, :3]), np.ascontiguousarray(poses[:, :3, 3])
        explained2 = self._params.explained_sigmas**2
        scoring.shares(few, rotations, positions, self.fine, explained2, found)
        pierced = scoring.pierced(
            few,
            rotations[0],
            positions[0],
            np.asarray(lidar, np.float64),
            self.fine,
            self._params.structure_height_m,
            p.pierced_margin_m,
            p.pierced_sigmas**2,
        )
        least = 1.0 / len(chosen)
        contrast = float(found[0] / max(found[1 : 1 + len(beside)].max(), least))
        covariance = match.covariance.copy()
        if found[0] < p.along_contrast * max(found[1 + len(beside) :].max(), least):
            direction = _worst_held(match)
            covariance[:2, :2] += p.along_sigma_m**2 * np.outer(direction, direction)
        return replace(match, covariance=covariance, contrast=contrast, pierced=float(pierced))

    def _along(self, match: Match) -> list[Floats]:
        """(4, 4) each: poses along the direction that is held worst."""
        steps = np.outer(
            np.concatenate([(away_m, -away_m) for away_m in self._params.beside.along_m]), _worst_held(match)
        )
        found = np.repeat(match.pose[None], len(steps), axis=0)
        found[:, :2, 3] += steps
        return list(found)

    def _beside(self, match: Match) -> list[Floats]:
        """(4, 4) each: poses that a sweep should distinguish from ``match``, at the same height over the ground."""
        p, here, found = self._params.beside, match.planar, []
        ground_m = self.ground_m(here.x, here.y)
        for away_m in p.away_m:
            for k in range(_DIRECTIONS):  # one is straight ahead: streets and corridors repeat along the way
                angle = here.yaw + k * math.tau / _DIRECTIONS
                pose = match.pose.copy()
                pose[:2, 3] += away_m * math.cos(angle), away_m * math.sin(angle)
                rise_m = self.ground_m(pose[0, 3], pose[1, 3]) - ground_m
                pose[2, 3] += rise_m if abs(rise_m) < 0.5 * away_m else 0.0  # steeper is a wall's lowest cell, or NaN
                found.append(pose)
        for turn_rad in (sign * rad for rad in p.turned_rad for sign in (-1.0, 1.0)):
            pose = match.pose.copy()
            pose[:3, :3] = kernels.turned(np.ascontiguousarray(pose[:3, :3]), np.array([0.0, 0.0, turn_rad]))
            found.append(pose)
        return found

    def _judged(
        self, points: Floats, rotation: Floats, position: Floats, converged: bool, iterations: int, reversals: int
    ) -> Match:
        p, information = self._params, np.empty((6, 6))
        structure, explained, known, residual = scoring.judge(
            points, rotation, position, self.fine, p.structure_height_m, p.explained_sigmas**2, information
        )
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, position
        information[3, 3] += 1.0 / p.tilt_sigma_rad**2
        information[4, 4] += 1.0 / p.tilt_sigma_rad**2
        return Match(
            pose=pose,
            covariance=self._covariance(information),
            score=explained / max(structure, 1),
            structure=int(structure),
            converged=converged and bool(np.isfinite(pose).all()),
            iterations=iterations,
            reversals=reversals,
            residual=float(residual),
            agreement=explained / max(known, 1),
        )

    def _covariance(self, information: Floats) -> Floats:
        p = self._params
        leaked = _NORMAL_RAD**2 * float(np.trace(information[:3, :3]))
        value, vector = np.linalg.eigh(information - np.diag([leaked, leaked, 0.0, 0.0, 0.0, 0.0]))
        # Unconstrained directions get 1 m, 1 rad: more would leak into the others, whose axes are not exact.
        spread = vector @ np.diag(1.0 / np.maximum(value, 1.0)) @ vector.T
        least = np.array([p.position_sigma_m] * 3 + [p.yaw_sigma_rad] * 3) ** 2
        covariance: Floats = p.covariance_scale**2 * 0.5 * (spread + spread.T) + np.diag(least)
        return covariance


def _worst_held(match: Match) -> Floats:
    """(2,) unit vector, map."""
    return np.asarray(np.linalg.eigh(match.planar_covariance[:2, :2])[1][:, 1])


def _mixture(size_m: float, outlier_share: float) -> tuple[float, float]:
    """d1 and d2 of the Gaussian that stands for a normal distribution with uniform outliers (Magnusson 2009, 6.10)."""
    c1, c2 = 10.0 * (1.0 - outlier_share), outlier_share / size_m**3
    d3 = -math.log(c2)
    d1 = -math.log(c1 + c2) - d3
    d2 = -2.0 * math.log((-math.log(c1 * math.exp(-0.5) + c2) - d3) / d1)
    return d1, d2


def _check(points: Floats, guess: Floats, up: Floats) -> None:
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise ValueError("points must be (n, 3) and finite")
    if guess.shape != (4, 4) or not np.isfinite(guess).all():
        raise ValueError("guess must be a finite (4, 4) pose")
    if up.shape != (3,) or not np.isfinite(up).all():
        raise ValueError("up must be (3,) and finite")

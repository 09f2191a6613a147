"""Search for the pose in a region of the map or all of it: correlate, match the best places, test for uniqueness."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import Pose2
from robot_stack.core.levels import Area
from robot_stack.localization.ndt import scoring
from robot_stack.localization.ndt.matcher import Match, NdtMatcher, pose_of
from robot_stack.localization.ndt.params import SearchParams

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Region:
    """The search region: within radius_m of (x_m, y_m), with headings within turn_rad of yaw_rad.

    An infinite radius is the whole map, pi every heading. area: the level to which all of it is restricted; None: the
    site has one level.
    """

    x_m: float
    y_m: float
    radius_m: float
    yaw_rad: float = 0.0
    turn_rad: float = math.pi
    area: Area | None = None

    def has(self, yaw_rad: float) -> bool:
        return abs(math.remainder(yaw_rad - self.yaw_rad, math.tau)) <= self.turn_rad


@dataclass(frozen=True, slots=True)
class Found:
    """Distinct poses, best first."""

    matches: tuple[Match, ...]

    @property
    def best(self) -> Match | None:
        return self.matches[0] if self.matches else None

    @property
    def second(self) -> Match | None:
        return self.matches[1] if len(self.matches) > 1 else None

    def rivals(self, params: SearchParams) -> tuple[Match, ...]:
        """The best and all that explain nearly as much, if the best is good enough; else none."""
        if self.best is None or self.best.score < params.min_score:
            return ()
        return tuple(match for match in self.matches if match.score >= params.ambiguous_ratio * self.best.score)

    def clear(self, params: SearchParams) -> bool:
        """True if the best is good enough, and no other nearly as good."""
        return len(self.rivals(params)) == 1


def search(matcher: NdtMatcher, points: Floats, up: Floats, region: Region, params: SearchParams) -> Found:
    """points: (n, 3) in base_link; up: (3,) vertical in base_link. The duration grows with the region."""
    standing = matcher.standing(points, up)
    places = _places(matcher, region, params.step_m)
    if len(standing) < 3 or not len(places):
        return Found(())
    level = pose_of(Pose2(0.0, 0.0, 0.0), 0.0, up)[:3, :3]
    chosen = np.linspace(0, len(standing) - 1, min(len(standing), params.points)).astype(np.intp)
    yaws = _yaws(region, params.yaw_steps)
    scores = np.empty((len(places), len(yaws)))
    scoring.correlate(np.ascontiguousarray(standing[chosen] @ level.T), matcher.wide, places, yaws, scores)
    matches = []
    for k, a in _peaks(scores, places, yaws, params):
        guess = pose_of(Pose2(places[k, 0], places[k, 1], float(yaws[a])), float(places[k, 2]), up)
        matches.append(matcher.match(points, guess, up, params.step_m))
    # A match may turn by half a step beyond the searched headings.
    inside = replace(region, turn_rad=region.turn_rad + math.pi / params.yaw_steps)
    usable = [match for match in matches if match.converged and inside.has(match.planar.yaw)]
    usable.sort(key=lambda match: -match.score)
    return Found(tuple(distinct(usable, params)))


def distinct(matches: Sequence[Match], params: SearchParams) -> list[Match]:
    """The matches, best first, that are distinct from every better one."""
    found: list[Match] = []
    for match in matches:
        if all(_apart(match, other, params) for other in found):
            found.append(match)
    return found


def _places(matcher: NdtMatcher, region: Region, step_m: float) -> Floats:
    """(k, 3) places of the map with ground, on a grid of step_m."""
    field = matcher.fine
    stride = max(1, round(step_m / field.size_m))
    rows, columns = np.nonzero(np.isfinite(field.ground[::stride, ::stride]))
    rows, columns = rows * stride, columns * stride
    x, y = (rows + field.corner[0] + 0.5) * field.size_m, (columns + field.corner[1] + 0.5) * field.size_m
    near = np.hypot(x - region.x_m, y - region.y_m) <= region.radius_m
    if (area := region.area) is not None:
        near &= (x >= area.min_x_m) & (x < area.max_x_m) & (y >= area.min_y_m) & (y < area.max_y_m)
    places: Floats = np.stack([x, y, field.ground[rows, columns]], axis=1)[near]
    return places


def _yaws(region: Region, steps: int) -> Floats:
    """(k,) headings of the region, from its middle on, rad."""
    step = math.tau / steps
    found = [region.yaw_rad + k * step for k in range(-(steps // 2), steps - steps // 2)]
    return np.array([yaw for yaw in found if region.has(yaw)])


def _peaks(scores: Floats, places: Floats, yaws: Floats, params: SearchParams) -> list[tuple[int, int]]:
    """The best candidates, none a neighbour of a better one."""
    taken: list[tuple[int, int]] = []
    turn, apart_rad = scores.shape[1], 1.5 * math.tau / params.yaw_steps
    for flat in np.argsort(-scores, axis=None)[: 50 * params.candidates]:
        k, a = divmod(int(flat), turn)
        if all(
            np.hypot(*(places[k, :2] - places[j, :2])) > 1.5 * params.step_m
            or abs(math.remainder(float(yaws[a] - yaws[b]), math.tau)) > apart_rad
            for j, b in taken
        ):
            taken.append((k, a))
            if len(taken) == params.candidates:
                break
    return taken


def _apart(match: Match, other: Match, params: SearchParams) -> bool:
    a, b = match.planar, other.planar
    return a.distance_to(b) > params.apart_m or abs(math.remainder(a.yaw - b.yaw, 2.0 * math.pi)) > params.apart_rad

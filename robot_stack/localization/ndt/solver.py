"""Request and result of matching one sweep: values exchanged between the localizer and the computing thread."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import Pose2
from robot_stack.core.levels import Area
from robot_stack.core.point_cloud import Points
from robot_stack.core.site_map import Cells
from robot_stack.localization.ndt import cloud
from robot_stack.localization.ndt.gate import lack_of_evidence
from robot_stack.localization.ndt.matcher import Match, NdtMatcher
from robot_stack.localization.ndt.params import NdtParams
from robot_stack.localization.ndt.search import Found, Region, search

Floats = npt.NDArray[np.float64]
# Of the voxels by which a sweep with few places is thinned.
_NEAR_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class MatchRequest:
    """Request for the pose of base_link at ``stamp_s``.

    sweep: SWEEP, sensor frame. motion: (k, 4), see :func:`robot_stack.localization.ndt.cloud.subsample`. guess: (4, 4).
    up: (3,) vertical in base_link. off_m: largest error of the guess. region: searched instead of the guess.
    guesses: (4, 4) each, several places instead of one.
    travelled: the dead-reckoned pose at the stamp. epoch: requests of an earlier one are obsolete.
    """

    stamp_s: float
    sweep: Points
    motion: Floats
    guess: Floats
    up: Floats
    off_m: float
    region: Region | None
    travelled: Pose2
    epoch: int
    guesses: tuple[Floats, ...] = ()


@dataclass(frozen=True, slots=True)
class MatchResult:
    """match: None if there is none, and problem gives the reason. points: number of matched points.

    unseen: of a sweep with too little structure, see :meth:`Skyline.unseen_share`.
    rivals: of a search, two or more places that fit alike; of guesses, the match from each.
    """

    request: MatchRequest
    match: Match | None
    points: int
    problem: str
    unseen: float = 0.0
    rivals: tuple[Match, ...] = ()


class SweepSolver:
    """Computes requests on one map. Stateless: usable from any thread.

    lidar_xyz_m: sensor in base_link. Raises ValueError for a map that cannot be matched against.
    """

    def __init__(self, cells: Cells, params: NdtParams, lidar_xyz_m: tuple[float, float, float]) -> None:
        self._params = params
        self._lidar = np.array(lidar_xyz_m, np.float64)
        self.matcher = NdtMatcher(cells, params.match)

    def solve(self, request: MatchRequest) -> MatchResult:
        c = self._params.cloud
        try:
            points = self._thinned(request, c.voxel_m)
            if len(points) < c.min_points:  # between near walls, as in the cabin of a lift
                points = self._thinned(request, _NEAR_SHARE * c.voxel_m)
        except ValueError as error:
            return MatchResult(request, None, 0, f"/sensors/lidar/points: {error}")
        if len(points) < c.min_points:
            return MatchResult(request, None, len(points), f"sweep has {len(points)} places, {c.min_points} are needed")
        if request.region is not None:
            return self._look(request, points, request.region)
        if request.guesses:
            return self._compare(request, points)
        match = self.matcher.match(points, request.guess, request.up, request.off_m)
        gate = self._params.gate
        if gate.evidence.least_score <= match.score < gate.sure_score:  # only then the gate uses it
            match = self.matcher.weighed(points, match, self._lidar)
        return MatchResult(request, match, len(points), "", self._unseen(request, match, points))

    def _thinned(self, request: MatchRequest, voxel_m: float) -> Floats:
        c = self._params.cloud
        return cloud.subsample(request.sweep, self._lidar, request.motion, voxel_m, c.min_range_m, c.max_range_m)

    def _unseen(self, request: MatchRequest, match: Match, points: Floats) -> float:
        """At the guess, not at the match: without structure a match may slide away."""
        gate = self._params.gate
        if match.structure >= gate.min_structure_points:
            return 0.0
        standing = self.matcher.standing(points, request.guess[2, :3])
        return self.matcher.skyline.unseen_share(
            request.guess, standing, gate.expected_range_m, gate.expected_directions
        )

    def _standing_out(self, region: Region, points: Floats, found: Found) -> Match | None:
        """Of a search of the whole map: the best place, if it explains little but every other one far less."""
        evidence, best, second = self._params.gate.evidence, found.best, found.second
        if best is None or math.isfinite(region.radius_m) or best.score < evidence.least_score:
            return None
        if second is not None and best.score < evidence.min_contrast * second.score:
            return None
        weighed = self.matcher.weighed(points, best, self._lidar)
        return None if lack_of_evidence(weighed, evidence) else weighed

    def _fits_nowhere_better(self, request: MatchRequest, points: Floats, near: Match, area: Area | None) -> bool:
        """The last pose selects between places that fit alike, but a better fit elsewhere overrules it."""
        everywhere = Region(0.0, 0.0, math.inf, area=area)
        best = search(self.matcher, points, request.up, everywhere, self._params.search).best
        return best is None or near.score >= self._params.search.near_ratio * best.score

    def _compare(self, request: MatchRequest, points: Floats) -> MatchResult:
        rivals = tuple(self.matcher.match(points, guess, request.up, request.off_m) for guess in request.guesses)
        if max(match.structure for match in rivals) < self._params.gate.min_structure_points:
            return MatchResult(request, None, len(points), "no structure to distinguish the poses")
        return MatchResult(request, None, len(points), f"{len(rivals)} poses fit", rivals=rivals)

    def _look(self, request: MatchRequest, points: Floats, region: Region) -> MatchResult:
        found = search(self.matcher, points, request.up, region, self._params.search)
        if found.best is not None and found.best.structure < self._params.gate.min_structure_points:
            return MatchResult(request, None, len(points), "no structure to find the pose")
        if found.best is not None and found.clear(self._params.search):
            if math.isinf(region.radius_m) or self._fits_nowhere_better(request, points, found.best, region.area):
                return MatchResult(request, found.best, len(points), "")
            return MatchResult(request, None, len(points), "a pose elsewhere fits better than those near the last")
        alone = self._standing_out(region, points, found)
        if alone is not None:
            return MatchResult(request, alone, len(points), "")
        score = 0.0 if found.best is None else found.best.score
        second = 0.0 if found.second is None else found.second.score
        problem = f"no clear pose in the map: best score {score:.2f}, second {second:.2f}"
        return MatchResult(request, None, len(points), problem, rivals=found.rivals(self._params.search))

"""One sweep's question and its answer: values that pass between the localizer and the thread that computes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import Pose2
from robot_stack.core.point_cloud import Points
from robot_stack.core.site_map import Cells
from robot_stack.localization.ndt import cloud, kernels, scoring
from robot_stack.localization.ndt.field import field_of
from robot_stack.localization.ndt.matcher import Match, NdtMatcher
from robot_stack.localization.ndt.params import NdtParams
from robot_stack.localization.ndt.search import Region, search

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Question:
    """Where was base_link at ``stamp_s``?

    sweep: SWEEP, sensor frame. motion: (k, 4), see :func:`robot_stack.localization.ndt.cloud.subsample`. guess: (4, 4).
    up: (3,) vertical in base_link. off_m: how far off the guess may be. region: look there instead of at the guess.
    travelled: the dead-reckoned pose at the stamp. epoch: questions of another one are no longer of interest.
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


@dataclass(frozen=True, slots=True)
class Answer:
    """match: None where there is none, and problem says why. points: how many were matched."""

    question: Question
    match: Match | None
    points: int
    problem: str


class SweepSolver:
    """Answers questions about one map. Without memory: any thread may ask.

    lidar_xyz_m: sensor in base_link. Raises ValueError for a map that cannot be matched against.
    """

    def __init__(self, cells: Cells, params: NdtParams, lidar_xyz_m: tuple[float, float, float]) -> None:
        self._params = params
        self._lidar = np.array(lidar_xyz_m)
        self.matcher = NdtMatcher(cells, params.match)

    def solve(self, question: Question) -> Answer:
        c = self._params.cloud
        try:
            points = cloud.subsample(
                question.sweep, self._lidar, question.motion, c.voxel_m, c.min_range_m, c.max_range_m
            )
        except ValueError as error:
            return Answer(question, None, 0, f"/sensors/lidar/points: {error}")
        if len(points) < c.min_points:
            return Answer(question, None, len(points), f"sweep has {len(points)} places, {c.min_points} are needed")
        if question.region is not None:
            return self._look(question, points, question.region)
        match = self.matcher.match(points, question.guess, question.up, question.off_m)
        return Answer(question, match, len(points), "")

    def _look(self, question: Question, points: Floats, region: Region) -> Answer:
        found = search(self.matcher, points, question.up, region, self._params.search)
        if found.clear(self._params.search):
            return Answer(question, found.best, len(points), "")
        score = 0.0 if found.best is None else found.best.score
        second = 0.0 if found.second is None else found.second.score
        problem = f"no clear pose in the map: best score {score:.2f}, second {second:.2f}"
        return Answer(question, None, len(points), problem)


def warm_up() -> None:
    """Compiles every kernel, or loads what an earlier process compiled: a match against four cells."""
    key = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.int32)
    spread = np.tile(0.01 * np.eye(3), (4, 1, 1))
    middle = key.astype(np.float64) + 0.5
    cells = Cells(1.0, key, middle, spread, np.full(4, 100))
    field = field_of(cells, 3)
    cloud.warm_up()
    points, rotation, position, information = middle, np.eye(3), np.zeros(3), np.empty((6, 6))
    prior, limits = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 1.0]), np.array([2.0, 0.1, 0.1, 1e-3, 1e-3])
    kernels.newton(points, rotation, position, field, -1.0, 1.0, prior, limits)
    scoring.judge(points, rotation, position, field, 0.4, 9.0, information)
    scoring.correlate(points, field, np.zeros((1, 3)), np.zeros(1), np.empty((1, 1)))

"""Match acceptance in a place not used for tuning: real sweeps beside the project, if they exist.

The map is made of some sweeps and another one is matched against it. small_gicp provides the reference poses. Parts of
the map are removed to simulate a changed world.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.core.point_cloud import SWEEP, Points
from robot_stack.core.site_map import Cells
from robot_stack.localization.ndt.field import structure_of
from robot_stack.localization.ndt.gate import problem_of
from robot_stack.localization.ndt.matcher import Match, planar, pose_of
from robot_stack.localization.ndt.params import NdtParams
from robot_stack.localization.ndt.search import Region
from robot_stack.localization.ndt.solver import MatchRequest, SweepSolver
from robot_stack.mapping.cells import cells_of
from tests.benchmarks.support.framework import BenchError, percentile
from tests.benchmarks.support.ground_real import FOLDER, SENSOR_HEIGHT_M

Array = NDArray[np.float64]
GONE = (0.0, 0.2, 0.35)
# Numbers of sweeps in a map.
SEVERAL = (2, 3, 5)
NEAR_M, NEAR_RAD = 0.1, math.radians(1.0)
_LIDAR = (0.0, 0.0, SENSOR_HEIGHT_M)
_UP = np.array([0.0, 0.0, 1.0])
_CAR_M, _FAR_M = 3.0, 80.0  # removes the car that carried the sensor
_CELL_M, _CELL_POINTS = 0.5, 5
# Standard deviations of a tracking filter's prediction: error and covariance.
_START_M, _START_RAD, _SIGMA_M, _SIGMA_RAD, _OFF_M = 0.3, math.radians(2.0), 0.1, 0.01, 0.4
_BOX_M, _SECTOR_RAD = 10.0, math.radians(24.0)
_ELSEWHERE_M, _TURNED_RAD = 3.0, math.radians(30.0)


@dataclass(frozen=True, slots=True)
class Place:
    """A map, a sweep that is not in it, and base_link of the sweep in the map.

    motion: (k, 4), see :func:`robot_stack.localization.ndt.cloud.subsample`. lidar: sensor in base_link, m.
    """

    cells: Cells
    sweep: Points
    truth: Pose2
    motion: Array = field(default_factory=lambda: np.zeros((1, 4)))
    lidar: tuple[float, float, float] = _LIDAR


@dataclass
class Tally:
    """Counts of match results. errors: m and rad of matches accepted at the right place. refused: reasons."""

    tried: int = 0
    errors: list[tuple[float, float]] = field(default_factory=list)
    wrong: int = 0
    refused: list[str] = field(default_factory=list)
    scores: list[float] = field(default_factory=list)
    mistakes: list[str] = field(default_factory=list)

    def add(self, match: Match | None, problem: str, truth: Pose2 | None) -> None:
        """truth: None if no pose in the map is right."""
        self.tried += 1
        if match is not None:
            self.scores.append(match.score)
        if problem or match is None:
            self.refused.append(problem)
        elif truth is not None and _is_at(match.planar, truth, NEAR_M, NEAR_RAD):
            self.errors.append((match.planar.distance_to(truth), _turn(match.planar, truth)))
        else:
            self.wrong += 1
            off = "" if truth is None else f", {match.planar.distance_to(truth):.2f} m off"
            self.mistakes.append(f"score {match.score:.2f}, contrast {match.contrast:.1f}{off}")

    def join(self, other: Tally) -> None:
        self.tried, self.wrong = self.tried + other.tried, self.wrong + other.wrong
        self.errors += other.errors
        self.refused += other.refused
        self.scores += other.scores
        self.mistakes += other.mistakes

    @property
    def refused_pct(self) -> float:
        return 100.0 * len(self.refused) / max(self.tried, 1)

    @property
    def wrong_pct(self) -> float:
        return 100.0 * self.wrong / max(self.tried, 1)


def places(folder: Path = FOLDER, of: int = 1) -> tuple[list[Place], float]:
    """Each sweep of the folder with a map of the ``of`` sweeps nearest in time, and the largest round-trip error, m.

    The sweeps are consecutive. The error is that of the reference between two of them, both ways. Returns no places if
    there are too few sweeps. Raises BenchError if small_gicp is missing or inconsistent.
    """
    clouds = [_points(file) for file in sorted(folder.glob("scan_*.bin"))]
    if len(clouds) <= of:
        return [], math.nan
    poses, apart_m = [np.eye(4)], 0.0
    for earlier, later in pairwise(clouds):
        there = _reference(earlier, later)
        round_trip = planar(there @ _reference(later, earlier))
        apart_m = max(apart_m, math.hypot(round_trip.x, round_trip.y))
        poses.append(poses[-1] @ there)
    if apart_m > 0.02:
        raise BenchError(f"ndt: small_gicp's own answers of both ways are {apart_m:.3f} m apart")
    found = []
    for index, xyz in enumerate(clouds):
        others = sorted((k for k in range(len(clouds)) if k != index), key=lambda k: abs(k - index))[:of]
        into = [np.linalg.inv(poses[others[0]]) @ poses[k] for k in others]
        mapped = [clouds[k] @ pose[:3, :3].T + pose[:3, 3] for k, pose in zip(others, into, strict=True)]
        cells = cells_of(np.concatenate([*mapped, _road()]), _CELL_M, _CELL_POINTS)
        truth = planar(np.linalg.inv(poses[others[0]]) @ poses[index])
        found.append(Place(cells, _sweep(xyz), truth))
    return found, apart_m


def tracked(
    place: Place, params: NdtParams, gone: float, maps: int, starts: int, random: np.random.Generator
) -> tuple[Tally, Tally]:
    """Matches with tracking priors: from starts near the truth, and as many from wrong starts."""
    right, wrong = Tally(), Tally()
    for count in range(maps if gone else 1):
        solver = SweepSolver(without(place.cells, gone, count % 2 == 0, params, random), params, place.lidar)
        several = starts if gone else maps * starts
        for guess in (_near(place.truth, random) for _ in range(several)):
            right.add(*_match(solver, params, place, guess), place.truth)
        for guess in _elsewhere(solver, place.truth, several, random):
            wrong.add(*_match(solver, params, place, guess), place.truth)
    return right, wrong


def searched(place: Place, params: NdtParams, gone: float, times: int, random: np.random.Generator) -> Tally:
    """Searches of the whole map, each with other parts removed and the robot at a random yaw."""
    tally = Tally()
    for count in range(times):
        seen = turned(place, random.uniform(-math.pi, math.pi))
        solver = SweepSolver(without(seen.cells, gone, count % 2 == 0, params, random), params, seen.lidar)
        tally.add(*_search(solver, seen), seen.truth)
    return tally


def in_another_world(
    cells: Cells, places: Sequence[Place], params: NdtParams, starts: int, random: np.random.Generator
) -> tuple[Tally, Tally]:
    """Sweeps from outside the map: matches from random poses, and one search each. Every acceptance is wrong."""
    matches, searches = Tally(), Tally()
    for place in places:
        solver = SweepSolver(cells, params, place.lidar)
        for guess in _anywhere(solver, starts, random):
            matches.add(*_match(solver, params, place, guess), None)
        searches.add(*_search(solver, place), None)
    return matches, searches


def figures(
    params: NdtParams, yard: Sequence[Place], seed: int, folder: Path = FOLDER
) -> tuple[dict[str, float], dict[str, object]]:
    """Figures and conditions of the yard and the real sweeps; without real sweeps, the conditions give the reason."""
    random = np.random.default_rng(seed)
    foreign, apart_m = places(folder)
    out, conditions = _of_a_site("yard", yard, foreign, params, 24, 1, random)
    conditions |= {
        "refused": f"by the gate, from starts up to {_START_M} m and {math.degrees(_START_RAD):.0f} deg off; 0, 20 and "
        "35 % of the map's cells above the ground gone in boxes of 10 m or sectors of 24 deg; score_alone: had the "
        "gate asked for min_score and nothing beside it, as it once did",
        "wrong_accepted": f"accepted farther than {NEAR_M} m or 1 deg from the truth: from the starts of refused, and "
        "as many 1-12 m along the way, turned by 30 deg and more, or anywhere; and in the other site's map",
        "found": "by a search of the whole map, the robot turned anyhow; wrong_found: other site's map included",
    }
    if not foreign:
        return out, conditions | {"kitti": f"no two scan_*.bin in {folder}: not measured"}
    others = yard[:: max(1, len(yard) // 6)]
    for count in (1, *SEVERAL):
        site = foreign if count == 1 else places(folder, count)[0]
        if site:
            name = "kitti" if count == 1 else f"kitti_of_{count}"
            figures, own = _of_a_site(name, site, others, params, 8, 5, random)
            out, conditions = out | figures, conditions | own
    conditions["kitti"] = (
        f"{len(foreign)} consecutive sweeps of {folder}: each against a map of the nearest one, kitti_of_n: of the "
        f"nearest n, and of the road under the car, cells of {_CELL_M} m; holes and starts are of a seed, but there is "
        "one street. Reference: small_gicp's GICP, then VGICP, of all points; both ways at most "
        f"{1e3 * apart_m:.0f} mm apart"
    )
    return out, conditions


def _of_a_site(
    name: str,
    site: Sequence[Place],
    others: Sequence[Place],
    params: NdtParams,
    maps: int,
    starts: int,
    random: np.random.Generator,
) -> tuple[dict[str, float], dict[str, object]]:
    """others: places of another site, whose sweeps match nowhere here. The maps are divided among the places."""
    out: dict[str, float] = {}
    counted, wrong, lost = Tally(), Tally(), Tally()
    said: dict[str, str] = {}
    for gone in GONE:
        right, looked = Tally(), Tally()
        for place in site:
            each = max(1, maps // len(site)) if len(site) > 2 else maps
            tallies = tracked(place, params, gone, each, starts, random)
            right.join(tallies[0])
            wrong.join(tallies[1])
            looked.join(searched(place, params, gone, each, random))
        share = f"{100.0 * gone:.0f}"
        out[f"{name}_refused_{share}_pct"] = right.refused_pct
        out[f"{name}_score_alone_refused_{share}_pct"] = 100.0 * float(
            np.mean(np.array(right.scores) < params.gate.min_score)
        )
        out[f"{name}_found_{share}_pct"] = 100.0 * len(looked.errors) / looked.tried
        counted.join(right)
        lost.join(looked)
        reasons = sorted(set(right.refused))[:3]
        said[f"{share} % gone"] = f"{min(right.scores):.2f}-{max(right.scores):.2f}, {right.tried} starts; {reasons}"
    said["wrong starts"] = f"up to {max(wrong.scores):.2f}, {len(wrong.scores)} starts"
    if others:
        matches, searches = in_another_world(site[0].cells, others, params, 40, random)
        wrong.join(matches)
        lost.join(searches)
    counted.join(wrong)
    errors = counted.errors
    out |= {f"{name}_wrong_accepted_pct": counted.wrong_pct, f"{name}_wrong_found_pct": lost.wrong_pct}
    if errors:
        out[f"{name}_err_mm_p50"] = 1e3 * percentile([metres for metres, _ in errors], 0.5)
        out[f"{name}_err_mm_p95"] = 1e3 * percentile([metres for metres, _ in errors], 0.95)
        out[f"{name}_err_deg_p95"] = math.degrees(percentile([turn for _, turn in errors], 0.95))
    return out, {
        f"{name}_scores": said,
        f"{name}_starts": counted.tried,
        f"{name}_searches": lost.tried,
        f"{name}_mistakes": counted.mistakes + lost.mistakes,
    }


def without(cells: Cells, share: float, boxes: bool, params: NdtParams, random: np.random.Generator) -> Cells:
    """The cells without ``share`` of those above the ground: boxes of 10 m, or sectors of 24 deg around the origin."""
    structure = structure_of(cells, params.match.structure_height_m)
    stands = np.isin(_packed(cells), _packed(structure))
    gone = np.zeros(len(cells.key), bool)
    bearing = np.arctan2(cells.mean[:, 1], cells.mean[:, 0])
    while np.count_nonzero(gone) < share * np.count_nonzero(stands):
        if boxes:
            middle = cells.mean[random.choice(np.flatnonzero(stands & ~gone)), :2]
            piece = np.abs(cells.mean[:, :2] - middle).max(axis=1) < 0.5 * _BOX_M
        else:
            away = np.mod(bearing - random.uniform(0.0, math.tau) + math.pi, math.tau) - math.pi
            piece = np.abs(away) < 0.5 * _SECTOR_RAD
        gone |= stands & piece
    kept = ~gone
    return Cells(cells.size_m, cells.key[kept], cells.mean[kept], cells.covariance[kept], cells.count[kept])


def _packed(cells: Cells) -> NDArray[np.int64]:
    key = cells.key.astype(np.int64) + (1 << 20)
    packed: NDArray[np.int64] = (key[:, 0] << 42) | (key[:, 1] << 21) | key[:, 2]
    return packed


def _match(solver: SweepSolver, params: NdtParams, place: Place, guess: Pose2) -> tuple[Match | None, str]:
    """The match from a guess, and the gate's reason for a rejection."""
    z_m = solver.matcher.ground_m(guess.x, guess.y)
    start = pose_of(guess, z_m if math.isfinite(z_m) else 0.0, _UP)
    answer = solver.solve(MatchRequest(0.0, place.sweep, place.motion, start, _UP, _OFF_M, None, IDENTITY, 0))
    if answer.match is None:
        return None, answer.problem
    return answer.match, problem_of(answer.match, guess, _SIGMA_M, _SIGMA_RAD, params.gate)


def _search(solver: SweepSolver, place: Place) -> tuple[Match | None, str]:
    region = Region(0.0, 0.0, math.inf)
    answer = solver.solve(MatchRequest(0.0, place.sweep, place.motion, np.eye(4), _UP, 0.0, region, IDENTITY, 0))
    return answer.match, answer.problem


def _near(truth: Pose2, random: np.random.Generator) -> Pose2:
    metres, angle = _START_M * math.sqrt(random.uniform()), random.uniform(0.0, math.tau)
    turn = random.uniform(-_START_RAD, _START_RAD)
    return Pose2(truth.x + metres * math.cos(angle), truth.y + metres * math.sin(angle), truth.yaw + turn)


def _elsewhere(solver: SweepSolver, truth: Pose2, count: int, random: np.random.Generator) -> Iterator[Pose2]:
    """In turns: along the street with its heading, at the right place with a wrong heading, and any pose."""
    anywhere = _anywhere(solver, 10 * count, random)
    for k in range(count):
        if k % 3 == 0:
            along = random.choice([-1.0, 1.0]) * random.uniform(1.0, 12.0)
            yield truth.compose(Pose2(along, random.uniform(-1.0, 1.0), random.uniform(-_START_RAD, _START_RAD)))
        elif k % 3 == 1:
            yield truth.compose(Pose2(0.0, 0.0, random.uniform(_TURNED_RAD, math.tau - _TURNED_RAD)))
        else:
            yield next(pose for pose in anywhere if not _is_at(pose, truth, _ELSEWHERE_M, _TURNED_RAD))


def _anywhere(solver: SweepSolver, count: int, random: np.random.Generator) -> Iterator[Pose2]:
    fine = solver.matcher.fine
    known = np.argwhere(np.isfinite(fine.ground))
    for _ in range(count):
        x, y = (known[random.integers(len(known))] + fine.corner[:2] + random.uniform(0.0, 1.0, 2)) * fine.size_m
        yield Pose2(float(x), float(y), random.uniform(-math.pi, math.pi))


def _points(file: Path) -> Array:
    """(n, 3) points without the car, shifted so that z = 0 is the road."""
    xyz = np.fromfile(file, np.float32).reshape(-1, 4)[:, :3].astype(np.float64)
    kept = (np.hypot(xyz[:, 0], xyz[:, 1]) > _CAR_M) & (np.linalg.norm(xyz, axis=1) < _FAR_M)
    points: Array = xyz[kept] + np.array(_LIDAR)
    return points


def _road() -> Array:
    """(n, 3) road points under the car, outside the sensor's view: a search needs ground at the robot's position."""
    x, y = np.meshgrid(*[np.arange(-_CAR_M - 1.0, _CAR_M + 1.0, 0.1)] * 2)
    inside = np.hypot(x, y) < _CAR_M + 1.0
    height_m = 0.01 * np.random.default_rng(0).standard_normal(np.count_nonzero(inside))
    return np.stack([x[inside], y[inside], height_m], axis=1)


def turned(place: Place, turn_rad: float) -> Place:
    """The place with base_link turned by ``turn_rad``, so that no true heading equals the first heading of a search."""
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    sweep, motion = place.sweep.copy(), place.motion.copy()
    sweep["x"], sweep["y"] = c * place.sweep["x"] + s * place.sweep["y"], c * place.sweep["y"] - s * place.sweep["x"]
    motion[:, 1], motion[:, 2] = (
        c * place.motion[:, 1] + s * place.motion[:, 2],
        c * place.motion[:, 2] - s * place.motion[:, 1],
    )
    x, y, z = place.lidar
    lidar = (c * x + s * y, c * y - s * x, z)
    return Place(place.cells, sweep, place.truth.compose(Pose2(0.0, 0.0, turn_rad)), motion, lidar)


def _sweep(xyz: Array) -> Points:
    """As the sensor sends it, already de-skewed, like this data."""
    sweep = np.zeros(len(xyz), SWEEP)
    sweep["x"], sweep["y"], sweep["z"] = (xyz - np.array(_LIDAR)).T
    return sweep


def _reference(target: Array, source: Array) -> Array:
    """(4, 4) source's base_link in the target's, by small_gicp's VGICP after its GICP, an independent reference."""
    try:
        import small_gicp
    except ModuleNotFoundError as error:
        raise BenchError("ndt: needs small_gicp beside it, which is not installed") from error
    clouds, trees = [], []
    for points in (target, source):
        cloud = small_gicp.voxelgrid_sampling(small_gicp.PointCloud(points), 0.25, 1)
        trees.append(small_gicp.KdTree(cloud))
        small_gicp.estimate_covariances(cloud, trees[-1], 20, 1)
        clouds.append(cloud)
    near = small_gicp.align(clouds[0], clouds[1], trees[0], max_correspondence_distance=2.0, num_threads=1)
    voxels = small_gicp.GaussianVoxelMap(_CELL_M)
    voxels.insert(clouds[0])
    result = small_gicp.align(
        voxels, clouds[1], init_T_target_source=near.T_target_source, max_correspondence_distance=1.0, num_threads=1
    )
    if not (near.converged and result.converged):
        raise BenchError("ndt: small_gicp does not converge on the sweeps")
    return np.asarray(result.T_target_source)


def _turn(one: Pose2, other: Pose2) -> float:
    return abs(math.remainder(one.yaw - other.yaw, math.tau))


def _is_at(pose: Pose2, truth: Pose2, metres: float, radians: float) -> bool:
    return pose.distance_to(truth) < metres and _turn(pose, truth) < radians

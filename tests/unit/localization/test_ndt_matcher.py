"""P2D-NDT: derivatives against differences, recovered poses, covariance, and matches that must be rejected."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.core.geometry import Pose2
from robot_stack.core.point_cloud import SWEEP, XYZ
from robot_stack.core.site_map import Cells
from robot_stack.localization.ndt import cloud, kernels
from robot_stack.localization.ndt.field import field_of, merged, structure_of
from robot_stack.localization.ndt.matcher import NdtMatcher, _mixture, pose_of
from robot_stack.mapping.cells import cells_of
from tests.unit.localization.courtyard import UP, cells, corridor, matcher, seen_from, surfaces, yaw_between
from tests.unit.localization.stories import params

TRUTH = Pose2(1.0, 2.0, 0.4)


def test_gradient_and_hessian_are_those_of_the_objective() -> None:
    # Away from voxel borders the set of neighbours is constant, so differences see one smooth function.
    field = field_of(merged(cells(), 1.0), 6)
    random = np.random.default_rng(3)
    rotation = kernels.turned(np.eye(3), np.array([0.05, -0.1, 0.8]))
    position = np.array([0.3, -0.2, 0.1])
    inside = np.floor(surfaces(5.0, seed=4)) + random.uniform(0.2, 0.8, (len(surfaces(5.0, seed=4)), 3))
    points = np.ascontiguousarray((inside - position) @ rotation)
    gradient, hessian = np.empty(6), np.empty((6, 6))
    kernels.derivatives(points, rotation, position, field, -2.0, 0.9, gradient, hessian)
    scratch, matrix = np.empty(6), np.empty((6, 6))

    def score(step: np.ndarray) -> float:
        turn = kernels.turned(rotation, np.ascontiguousarray(step[3:]))
        return float(kernels.derivatives(points, turn, position + step[:3], field, -2.0, 0.9, scratch, matrix))

    unit, h = np.eye(6), 1e-4
    slopes = [(score(h * e) - score(-h * e)) / (2.0 * h) for e in unit]
    assert gradient == pytest.approx(slopes, rel=1e-4, abs=1e-4 * float(np.abs(gradient).max()))

    def slope(step: np.ndarray) -> np.ndarray:
        turn = kernels.turned(rotation, np.ascontiguousarray(step[3:]))
        kernels.derivatives(points, turn, position + step[:3], field, -2.0, 0.9, scratch, matrix)
        return scratch.copy()

    # Slopes at the moved pose use its own increments; the mean of both orders is the second derivative of exp at 0.
    curves = np.array([(slope(h * e) - slope(-h * e)) / (2.0 * h) for e in unit])
    curves = 0.5 * (curves + curves.T)
    assert np.abs(hessian - curves).max() < 1e-3 * np.abs(hessian).max()


def test_mixture_has_the_height_and_width_of_the_normal_distribution_with_outliers() -> None:
    # Magnusson 2009: -log(c1 exp(-m2/2) + c2) and d1 exp(-d2 m2/2) - d3... agree at m2 = 0, 1 and far away.
    d1, d2 = _mixture(1.0, 0.55)
    c1, c2 = 10.0 * 0.45, 0.55
    for m2 in (0.0, 1.0):
        exact = -math.log(c1 * math.exp(-0.5 * m2) + c2) + math.log(c2)
        assert d1 * math.exp(-0.5 * d2 * m2) == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("off", [Pose2(1.0, 0.6, 0.17), Pose2(-0.8, 1.2, -0.2)])
def test_the_pose_is_found_again(off: Pose2) -> None:
    truth = pose_of(TRUTH, 0.02, UP)
    points = seen_from(truth, surfaces(8.0, seed=7))
    match = matcher().match(points, pose_of(TRUTH.compose(off), 0.0, UP), UP, 3.0)
    assert match.converged
    assert match.planar.distance_to(TRUTH) < 0.01
    assert yaw_between(match.planar, TRUTH) < 0.002
    assert match.score > 0.9
    assert match.structure > 100


def test_a_tilted_robot_is_found_with_its_tilt() -> None:
    tilt = 0.08
    up = np.array([-math.sin(tilt), 0.0, math.cos(tilt)])
    truth = pose_of(TRUTH, 0.3, up)
    assert truth[:3, :3] @ up == pytest.approx(UP, abs=1e-12)
    match = matcher().match(seen_from(truth, surfaces(8.0, seed=7)), pose_of(TRUTH, 0.2, up), up, 0.1)
    assert match.planar.distance_to(TRUTH) < 0.01
    assert match.tilt_rad == pytest.approx(tilt, abs=0.005)
    assert match.pose[2, 3] == pytest.approx(0.3, abs=0.01)


def test_match_errors_agree_with_covariance() -> None:
    squares = []
    for seed in range(12):
        truth = pose_of(Pose2(0.3 * seed - 1.0, 0.1 * seed, 0.3 * seed), 0.02, UP)
        match = matcher().match(seen_from(truth, surfaces(4.0, seed=20 + seed)), truth, UP, 0.1)
        error = np.array([truth[0, 3] - match.planar.x, truth[1, 3] - match.planar.y, 0.0])
        error[2] = math.remainder(0.3 * seed - match.planar.yaw, math.tau)
        squares.append(float(error @ np.linalg.solve(match.planar_covariance, error)))
    assert np.mean(squares) < 3.0  # as for a correct covariance of three values


def test_a_bare_corridor_leaves_the_pose_open_along_it() -> None:
    walls = NdtMatcher(cells_of(corridor(40.0, seed=1), 0.5, 5), params().ndt.match)
    truth = pose_of(Pose2(0.0, 0.3, 0.0), 0.02, UP)
    match = walls.match(seen_from(truth, corridor(6.0, seed=2), 20.0), truth, UP, 0.1)
    sigma = np.sqrt(np.diag(match.planar_covariance))
    assert sigma[0] > 0.3
    assert sigma[1] < 0.05
    assert sigma[2] < 0.01


def test_a_wrong_pose_has_a_low_score() -> None:
    points = seen_from(pose_of(TRUTH, 0.02, UP), surfaces(8.0, seed=7))
    match = matcher().match(points, pose_of(Pose2(-5.0, -3.0, 2.0), 0.0, UP), UP, 0.1)
    assert match.score < 0.55


def test_match_rejects_non_finite_input() -> None:
    good = np.ones((10, 3))
    with pytest.raises(ValueError, match="points"):
        matcher().match(np.full((10, 3), np.nan), np.eye(4), UP, 0.1)
    with pytest.raises(ValueError, match="guess"):
        matcher().match(good, np.full((4, 4), np.inf), UP, 0.1)
    with pytest.raises(ValueError, match="up"):
        matcher().match(good, np.eye(4), np.array([0.0, np.nan, 1.0]), 0.1)


def test_no_points_give_no_information() -> None:
    match = matcher().match(np.empty((0, 3)), np.eye(4), UP, 0.1)
    assert match.score == 0.0
    assert match.planar_covariance[0, 0] > 1.0


def test_merged_cells_are_those_of_all_their_points() -> None:
    points = surfaces(20.0, seed=5)
    fine, coarse = cells_of(points, 0.5, 2), cells_of(points, 2.0, 2)
    all_fine = merged(fine, 2.0)
    rows = {tuple(key): row for row, key in enumerate(coarse.key.tolist())}
    whole = [(a, rows[tuple(k)]) for a, k in enumerate(all_fine.key.tolist())]
    whole = [(a, b) for a, b in whole if all_fine.count[a] == coarse.count[b]]
    assert len(whole) > 50
    for a, b in whole:
        assert all_fine.mean[a] == pytest.approx(coarse.mean[b], abs=1e-9)
        assert all_fine.covariance[a] == pytest.approx(coarse.covariance[b], abs=1e-9)
    with pytest.raises(ValueError, match="merged"):
        merged(fine, 0.7)


def test_structure_contains_only_cells_above_lowest_of_column() -> None:
    key = np.array([[0, 0, 0], [0, 0, 2], [1, 0, 0]], np.int32)
    mean = key.astype(np.float64) + 0.5
    found = structure_of(Cells(1.0, key, mean, np.tile(np.eye(3), (3, 1, 1)), np.full(3, 9)), 0.4)
    assert found.key.tolist() == [[0, 0, 2]]


def test_a_map_without_usable_cells_is_refused() -> None:
    with pytest.raises(ValueError, match="no cell"):
        field_of(cells(), 10**9)


def test_sweep_is_thinned_and_moved_to_its_stamp() -> None:
    sweep = np.zeros(5, SWEEP)
    sweep["x"], sweep["z"] = [5.0, 5.1, np.nan, 0.3, 80.0], -0.2
    sweep["time"] = [-0.1, -0.1, 0.0, 0.0, 0.0]
    # At 1 m/s ahead for 0.1 s, a point measured 5.05 m ahead of the sensor is now 4.95 m ahead of it.
    motion = np.array([[-0.1, -0.1, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    points = cloud.subsample(sweep, np.array([0.2, 0.0, 0.7]), motion, 0.5, 1.0, 50.0)
    assert points == pytest.approx(np.array([[5.15, 0.0, 0.5]]), abs=1e-6)


def test_a_sweep_of_many_places_keeps_them_all() -> None:
    """More voxels than the initial table holds: 100 x 100."""
    sweep = np.zeros(20_000, SWEEP)
    grid = np.arange(100) * 0.5 + 0.25 - 25.0
    sweep["x"], sweep["y"] = np.tile(np.repeat(grid, 100), 2), np.tile(grid, 200)
    points = cloud.subsample(sweep, np.zeros(3), np.zeros((1, 4)), 0.5, 0.0, 50.0)
    np.testing.assert_allclose(points[:, :2], np.stack([sweep["x"], sweep["y"]], axis=1)[:10_000], atol=1e-6)


def test_a_turn_during_the_sweep_is_taken_out() -> None:
    sweep = np.zeros(1, SWEEP)
    sweep["x"], sweep["time"] = 10.0, -0.05
    motion = np.array([[-0.1, 0.0, 0.0, -0.1], [0.0, 0.0, 0.0, 0.0]])
    points = cloud.subsample(sweep, np.zeros(3), motion, 0.5, 1.0, 50.0)
    assert points[0] == pytest.approx([10.0 * math.cos(0.05), -10.0 * math.sin(0.05), 0.0], abs=1e-6)


def test_useless_sweeps_are_empty_or_refused() -> None:
    still = np.zeros((1, 4))
    assert cloud.subsample(np.zeros(0, SWEEP), np.zeros(3), still, 0.5, 1.0, 50.0).shape == (0, 3)
    broken = np.zeros(3, SWEEP)
    broken["x"], broken["time"] = 5.0, [np.nan, 0.1, np.inf]
    assert cloud.subsample(broken, np.zeros(3), still, 0.5, 1.0, 50.0).shape == (0, 3)
    with pytest.raises(ValueError, match="sweep"):
        cloud.subsample(np.zeros(3, XYZ), np.zeros(3), still, 0.5, 1.0, 50.0)
    with pytest.raises(ValueError, match="motion"):
        cloud.subsample(np.zeros(3, SWEEP), np.zeros(3), np.full((1, 4), np.nan), 0.5, 1.0, 50.0)

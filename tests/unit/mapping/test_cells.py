"""Means, covariances and counts per voxel."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.mapping.cells import CellAccumulator, cells_of


def test_hand_worked_cell():
    points = np.array([[0.1, 0.2, 0.3], [0.3, 0.2, 0.3], [0.1, 0.4, 0.3], [0.3, 0.4, 0.9], [5.0, 5.0, 5.0]])
    cells = cells_of(points, 1.0, 4)
    assert cells.key.tolist() == [[0, 0, 0]]
    assert cells.count.tolist() == [4]
    np.testing.assert_allclose(cells.mean, [[0.2, 0.3, 0.45]], atol=1e-12)
    # Deviations x: -.1 .1 -.1 .1, y: -.1 -.1 .1 .1, z: -.15 -.15 -.15 .45; sums of products by 3.
    expected = np.array([[0.04, 0.0, 0.06], [0.0, 0.04, 0.06], [0.06, 0.06, 0.27]]) / 3.0
    np.testing.assert_allclose(cells.covariance[0], expected, atol=1e-12)


def test_a_far_origin_costs_no_digits():
    near = np.random.default_rng(0).normal(0.5, 0.02, (200, 3)).clip(0.01, 0.99)
    far = near + np.array([40_000.0, -40_000.0, 0.0])
    np.testing.assert_allclose(cells_of(far, 1.0, 6).covariance, cells_of(near, 1.0, 6).covariance, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31), st.integers(1, 6), st.integers(2, 9))
def test_many_sweeps_are_one_cloud(seed, sweeps, min_points):
    random = np.random.default_rng(seed)
    clouds = [random.uniform(-2.0, 2.0, (random.integers(0, 80), 3)) for _ in range(sweeps)]
    accumulator = CellAccumulator(0.7)
    for cloud in clouds:
        accumulator.add(cloud)
    one, many = cells_of(np.concatenate(clouds), 0.7, min_points), accumulator.cells(min_points)
    np.testing.assert_array_equal(one.key, many.key)
    np.testing.assert_array_equal(one.count, many.count)
    np.testing.assert_allclose(one.mean, many.mean, atol=1e-9)
    np.testing.assert_allclose(one.covariance, many.covariance, atol=1e-9)
    assert (np.floor(many.mean / 0.7) == many.key).all()
    for cell, key in zip(many.covariance, many.key, strict=True):
        inside = np.concatenate(clouds)
        inside = inside[(np.floor(inside / 0.7) == key).all(axis=1)]
        np.testing.assert_allclose(cell, np.cov(inside.T), atol=1e-9)


@pytest.mark.parametrize("value", [np.nan, -np.inf, 1e9])
def test_non_finite_or_huge_points_are_rejected(value):
    with pytest.raises(ValueError, match="finite"):
        cells_of(np.array([[0.0, value, 0.0]]), 1.0, 2)


@pytest.mark.parametrize(
    ("points", "size_m", "min_points", "word"),
    [(np.zeros((4, 2)), 1.0, 2, "points"), (np.zeros((4, 3)), 0.0, 2, "size_m"), (np.zeros((4, 3)), 1.0, 1, "min_p")],
)
def test_wrong_arguments_are_named(points, size_m, min_points, word):
    with pytest.raises(ValueError, match=word):
        cells_of(points, size_m, min_points)


def test_no_points_make_no_cells():
    cells = cells_of(np.empty((0, 3)), 1.0, 6)
    assert cells.mean.shape == (0, 3)
    assert cells.covariance.shape == (0, 3, 3)

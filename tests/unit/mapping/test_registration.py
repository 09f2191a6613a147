"""Registration of a sweep on distributions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from robot_stack.mapping.cells import cells_of
from robot_stack.mapping.poses import difference, inverse, moved, transform
from robot_stack.mapping.registration import align, target_of


def corner(random, count: int) -> np.ndarray:
    """Returns points on a floor and two walls with 1 cm roughness, m."""
    a, b = random.uniform(0.05, 5.95, (2, 3 * count))
    rough = random.normal(0.0, 0.01, 3 * count)
    floor, wall_x, wall_y = np.split(np.arange(3 * count), 3)
    points = np.empty((3 * count, 3))
    points[floor] = np.stack([a[floor], b[floor], rough[floor] + 0.02], axis=1)
    points[wall_x] = np.stack([rough[wall_x] + 6.2, a[wall_x], b[wall_x] * 0.4], axis=1)
    points[wall_y] = np.stack([a[wall_y], rough[wall_y] + 6.2, b[wall_y] * 0.4], axis=1)
    return points


@pytest.fixture(scope="module")
def targets():
    points = corner(np.random.default_rng(0), 6000)
    return [target_of(cells_of(points, size_m, 8)) for size_m in (2.0, 1.0, 0.5)]


def displaced(seed: int, within_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(true pose, sweep, initial pose) with an error of up to ``within_m`` in each axis and 0.05 rad."""
    random = np.random.default_rng(seed)
    truth = moved(np.eye(4), np.array([2.0, 3.0, 0.7, 0.0, 0.0, 0.4]))
    sweep = transform(inverse(truth), corner(random, 500))
    step = np.concatenate([random.uniform(-within_m, within_m, 3), random.uniform(-0.05, 0.05, 3)])
    return truth, sweep, moved(truth, step)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**31))
def test_a_displaced_sweep_comes_back(targets, seed):
    truth, sweep, initial = displaced(seed, within_m=0.1)
    found = align(sweep, targets, initial)
    error = difference(found.pose, truth)
    assert np.linalg.norm(error[:3]) < 0.02
    assert np.linalg.norm(error[3:]) < 0.005
    assert found.share > 0.9


@settings(max_examples=15, deadline=None)
@example(168)
@example(319)
@given(st.integers(0, 2**31))
def test_a_sweep_that_ends_in_a_neighbouring_minimum_fits_badly(targets, seed):
    """From 0.3 m in each axis 17 of 3,000 seeds, 168 and 319 among them, end 0.3 m from the truth."""
    truth, sweep, initial = displaced(seed, within_m=0.3)
    found = align(sweep, targets, initial)
    error = difference(found.pose, truth)
    assert found.share < 0.7 or (np.linalg.norm(error[:3]) < 0.02 and np.linalg.norm(error[3:]) < 0.005)


def test_a_sweep_of_another_place_does_not_fit(targets):
    elsewhere = np.random.default_rng(2).uniform(0.0, 6.0, (800, 3))
    assert align(elsewhere, targets, np.eye(4)).share < 0.5


def test_an_empty_map_moves_nothing():
    empty = target_of(cells_of(np.empty((0, 3)), 1.0, 6))
    found = align(np.ones((5, 3)), [empty], np.eye(4))
    np.testing.assert_array_equal(found.pose, np.eye(4))
    assert found.share == 0.0

"""Distances of a grid's cells to the nearest occupied one."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from robot_stack.core.distance_field import NOTHING_OCCUPIED, distance_field


@pytest.fixture
def threads() -> Iterator[None]:
    before = cv2.getNumThreads()
    yield
    cv2.setNumThreads(before)


@pytest.mark.parametrize("share", [0.1, 0.01, 0.0005])
def test_result_is_exact_and_the_same_for_any_number_of_threads(share: float, threads: None) -> None:
    occupied = np.random.default_rng(3).random((431, 307)) < share
    squared = np.rint(distance_transform_edt(~occupied) ** 2)
    for count in (1, 2, 4):
        cv2.setNumThreads(count)
        assert np.array_equal(distance_field(occupied), np.sqrt(squared.astype(np.float32)))


def test_grid_without_occupied_cells_is_far_from_everything() -> None:
    assert np.all(distance_field(np.zeros((40, 30), bool)) == NOTHING_OCCUPIED)

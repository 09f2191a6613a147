"""Thinned sweeps for remote viewers."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.core.config import ConfigError, load, validate
from robot_stack.core.point_cloud import SWEEP, XYZ, Points, points_from_xyz, xyz_of
from robot_stack.view.remote_params import RemoteCloudParams, RemoteViewParams
from robot_stack.view.thinning import thinned
from tests.unit.perception.scenes import Solid, sweep

PARAMS = RemoteCloudParams(range_m=40.0, voxel_m=0.5, points_max=5000)
DATAGRAM_BYTES = 65_000


def cloud(*rows: tuple[float, float, float]) -> Points:
    return points_from_xyz(np.array(rows, np.float32).reshape(-1, 3))


def rows_of(points: Points) -> set[tuple[float, ...]]:
    return {tuple(row) for row in xyz_of(points).tolist()}


def test_a_voxel_keeps_one_of_its_points() -> None:
    kept = thinned(cloud((0.1, 0.1, 0.1), (0.2, 0.2, 0.2), (0.6, 0.1, 0.1), (0.1, 0.1, -0.1)), PARAMS)
    assert len(kept) == 3
    assert rows_of(kept) > rows_of(cloud((0.6, 0.1, 0.1), (0.1, 0.1, -0.1)))


def test_every_point_of_the_sweep_has_a_kept_one_in_its_voxel() -> None:
    given = sweep([Solid((4.0, -3.0, 0.0), (4.3, 3.0, 2.0))])
    kept = thinned(given, PARAMS)
    assert len(kept) < PARAMS.points_max, "voxels of the parameters' size"
    assert kept.dtype == XYZ
    assert rows_of(kept) < rows_of(given)
    voxels, shown = (np.floor(xyz_of(item) / PARAMS.voxel_m) for item in (given, kept))
    near = np.linalg.norm(xyz_of(given), axis=1) <= PARAMS.range_m
    assert {tuple(row) for row in voxels[near].tolist()} == {tuple(row) for row in shown.tolist()}


def test_points_that_are_not_finite_or_too_far_are_left_out() -> None:
    far = (40.5, 0.0, 0.0)
    wrong = [(np.nan, 1.0, 1.0), (1.0, np.inf, 1.0), (1.0, 1.0, -np.inf), (3e38, 3e38, 3e38), far]
    assert rows_of(thinned(cloud((1.0, 2.0, 3.0), *wrong), PARAMS)) == {(1.0, 2.0, 3.0)}
    assert len(thinned(cloud(*wrong), PARAMS)) == len(thinned(np.empty(0, SWEEP), PARAMS)) == 0


@pytest.mark.parametrize("points_max", [100, 5000])
def test_any_sweep_fits(points_max: int) -> None:
    """Returns that fill the space, as in heavy snow: no two share a voxel."""
    params = RemoteCloudParams(range_m=200.0, voxel_m=0.05, points_max=points_max)
    spread = np.random.default_rng(0).uniform(-100.0, 100.0, (30_000, 3))
    kept = thinned(points_from_xyz(spread), params)
    assert points_max / 3 < len(kept) <= points_max


def test_the_largest_configurable_cloud_is_one_datagram() -> None:
    with pytest.raises(ConfigError):
        validate(RemoteCloudParams, {"range_m": 40.0, "voxel_m": 0.3, "points_max": 5001}, "remote_view")
    assert 5000 * XYZ.itemsize < DATAGRAM_BYTES


def test_the_configured_cloud_of_a_full_sweep_has_60_kb_at_most_and_shows_the_surroundings() -> None:
    given = sweep([Solid((4.0, -3.0, 0.0), (4.3, 3.0, 2.0)), Solid((-9.0, -20.0, 0.0), (-8.0, 20.0, 3.0))])
    kept = thinned(given, load(RemoteViewParams, "remote_view").cloud)
    assert 1000 < len(kept) <= 5000

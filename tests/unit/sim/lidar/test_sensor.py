"""Effects of the sensor: noise, drop-outs, wet ground, faults, the order of beams, the true mounting."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from robot_stack.core.point_cloud import SWEEP
from sim.camera.motion import still
from sim.lidar import labels
from sim.lidar.params import LidarParams, load_lidar_params
from sim.lidar.sensor import Conditions, join
from sim.lidar.views import sweep_at

from .scenes import ROBOT, TRUE_RINGS, UP_M, changed, exact, lidar, pose, world

WALL = {"name": "wall", "x_m": 6.0, "y_m": 0.0, "length_m": 2.0, "width_m": 8.0, "height_m": 3.0}
HERE = still(np.eye(4))


def wall_points(noise: dict[str, float], conditions: Conditions, seed: int = 3) -> np.ndarray:
    sensor = lidar(world(walls=[WALL]), changed(ranging=noise, mounting={"position_m": 0.0, "rotation_rad": 0.0}), seed)
    sweep = sensor.sweep(HERE, 0.0, conditions=conditions)
    return sweep.points[sweep.labels == labels.WALL]


def misses(points: np.ndarray) -> np.ndarray:
    """Returns the range error relative to the wall's face at 4.8 m."""
    xyz = np.c_[points["x"], points["y"], points["z"]].astype(float)
    far = np.linalg.norm(xyz, axis=1)
    return far - 4.8 * far / xyz[:, 0]


def test_the_full_size_is_150_000_beams() -> None:
    beams = load_lidar_params().beams
    assert beams.rings * beams.columns == 150_016
    assert (beams.lowest_deg, beams.highest_deg, beams.period_s) == (-30.0, 15.0, 0.1)
    with pytest.raises(ValidationError, match="columns must be even"):
        load_lidar_params().with_columns(361)


def test_range_noise_is_normal_with_2_cm_times_a_factor() -> None:
    factor = 5.0
    error = misses(wall_points({"mixed_share": 0.0, "lost_share": 0.0}, Conditions(noise_factor=factor)))
    count = len(error)
    assert count > 1500
    sigma = 0.02 * factor
    assert abs(error.mean()) < 4.0 * sigma / math.sqrt(count)
    assert error.std() == pytest.approx(sigma, rel=0.1)
    assert 0.29 < np.mean(np.abs(error) > sigma) < 0.345, "31.7 % of a normal distribution lie outside one sigma"
    first, again, other = (sweep_at(world(walls=[WALL]), np.eye(4), seed=seed)[0] for seed in (4, 4, 5))
    assert np.array_equal(first, again), "a seed is a sensor"
    assert len(first) != len(other) or not np.array_equal(first, other)
    with pytest.raises(ValueError, match="finite"):
        still(np.full((4, 4), np.nan))


def test_far_dark_and_flat_surfaces_are_lost() -> None:
    def seen(reflectivity: float, distance_m: float) -> float:
        wall = {**WALL, "x_m": distance_m + 1.0, "height_m": 20.0, "width_m": 100.0}
        sensor = lidar(world(walls=[wall], surfaces={"wall": reflectivity}), changed(ranging={"lost_share": 0.0}))
        every, _, _ = sensor.ranges(HERE, np.zeros(360), 0, 360, {})
        ahead = slice(160, 200)
        sweep = sensor.sweep(HERE, 0.0)
        column = np.round((math.pi - np.arctan2(sweep.points["y"], sweep.points["x"])) * 360 / math.tau)
        mine = (sweep.labels == labels.WALL) & (column >= 160) & (column < 200) & (sweep.points["ring"] > 42)
        return mine.sum() / np.isfinite(every[ahead, 43:]).sum()

    assert seen(0.5, 10.0) > 0.99
    assert seen(0.02, 40.0) == pytest.approx(0.5, abs=0.08), "signal 1: 0.02 / 0.1 (90 / 40)^2, by half"
    assert seen(0.005, 40.0) < 0.1
    points, _ = sweep_at(world(), np.eye(4))
    far = np.hypot(points["x"], points["y"])
    assert (far < 10.0).mean() > 0.9
    assert far.max() < 45.0, "flat ground is lost long before the end of range"


def test_wet_ground_swallows_beams_and_mirrors_others() -> None:
    puddle = {"name": "puddle", "x_m": 3.0, "y_m": 0.0, "length_m": 2.0, "width_m": 3.0, "friction": 0.2}
    dry = {**puddle, "friction": 0.6}
    wall = {**WALL, "x_m": 6.0}
    params = changed(
        720,
        ranging={"noise_m": 0.0, "mixed_share": 0.0, **TRUE_RINGS},
        mounting={"position_m": 0.0, "rotation_rad": 0.0},
    )

    def inside(patch: dict[str, object]) -> tuple[int, np.ndarray]:
        points, found = sweep_at(world(walls=[wall], patches=[patch]), np.eye(4), params=params)
        mine = (abs(points["x"] - 2.8) < 1.0) & (abs(points["y"]) < 1.5) & (found == labels.GROUND)
        return int(mine.sum()), points[found == labels.MIRROR]

    wet_count, mirrored = inside(puddle)
    dry_count, nothing = inside(dry)
    assert 0.1 < wet_count / dry_count < 0.6
    assert len(nothing) == 0
    assert len(mirrored) > 20
    assert (mirrored["z"] < -0.7).all(), "below the ground"
    assert np.allclose(mirrored["x"], 4.8, atol=1e-3), "where the wall stands"


def test_edges_mix_ranges_only_if_they_may() -> None:
    pole = {"name": "pole", "x_m": 3.0, "y_m": 0.0, "radius_m": 0.2, "height_m": 2.0}

    def between(share: float, wall_m: float = 4.1) -> int:
        file = world(walls=[{**WALL, "x_m": wall_m + 1.2}], cylinders=[pole])
        quiet = {"noise_m": 0.0, "lost_share": 0.0, "mixed_share": share}
        points, _ = sweep_at(file, np.eye(4), params=changed(ranging=quiet))
        upper = points["z"] > -0.3
        return int((upper & (points["x"] > 3.1) & (points["x"] < wall_m - 0.4) & (abs(points["y"]) < 0.5)).sum())

    assert between(0.0) == 0
    assert between(1.0) > 10
    assert between(1.0, 5.0) == 0, "two surfaces so far apart are two returns"


def test_a_covered_lens_sees_only_itself() -> None:
    sensor = lidar(world(walls=[WALL]), exact())
    for share in (1.0, 0.25):
        sweep = sensor.sweep(HERE, 0.0, conditions=Conditions(covered_share=share))
        far = np.linalg.norm(np.c_[sweep.points["x"], sweep.points["y"], sweep.points["z"]], axis=1)
        angle = np.abs(np.arctan2(sweep.points["y"], sweep.points["x"]))
        near = sweep.labels == labels.NEAR
        assert (far[near] < 0.5).all()
        assert (angle[near] <= math.pi * share + 1e-6).all()
        assert not (angle[~near] < math.pi * share - 0.02).any()
        assert near.sum() == pytest.approx(0.2 * share * 64 * 360, rel=0.1)


def test_beams_are_in_firing_order_and_half_sweeps_join_to_full_sweep() -> None:
    sensor = lidar(world(walls=[WALL]), exact())
    whole = sensor.sweep(HERE, 7.0)
    first, second = sensor.half_sweep(HERE, 6.95, 0), sensor.half_sweep(HERE, 7.0, 1)
    joined = join(first, second)
    assert joined.points.dtype == whole.points.dtype == SWEEP
    assert len(joined.points) == len(whole.points)
    for name in ("x", "y", "z", "ring"):
        assert np.array_equal(joined.points[name], whole.points[name])
    assert np.allclose(joined.points["time"], whole.points["time"], atol=1e-6)
    assert np.array_equal(joined.labels, whole.labels)
    times = whole.points["time"]
    assert (np.diff(times) >= 0.0).all()
    assert times[-1] == 0.0
    assert times[0] == pytest.approx(-0.1 * 359 / 360, abs=1e-6)
    same_column = np.diff(times) == 0.0
    assert (np.diff(whole.points["ring"].astype(int))[same_column] > 0).all()
    assert (first.points["y"] > -1e-3).all(), "the first half is the left side"
    assert (second.points["y"] < 1e-3).all()


def test_the_true_mounting_is_close_to_the_nominal_one_and_of_the_seed() -> None:
    params = load_lidar_params().with_columns(8)
    mountings = [lidar(world(), params, seed).mounting for seed in range(10)]
    for mounting in mountings:
        assert 0.0 < np.linalg.norm(mounting[:3, 3] - ROBOT.lidar_xyz_m) <= 0.003
        assert 0.0 < math.acos(min(1.0, 0.5 * (np.trace(mounting[:3, :3]) - 1.0))) <= 0.000873 + 1e-6
    assert len({tuple(mounting.ravel()) for mounting in mountings}) == 10


def test_resting_sensor_caches_static_ranges_and_updates_people() -> None:
    file = world(walls=[WALL], pits=[{"name": "pit", "x_m": 2, "y_m": 1, "length_m": 1, "width_m": 1, "depth_m": 0.3}])
    resting, arriving = (lidar(file, exact(), people=("person_anna",)) for _ in range(2))
    times = np.arange(-179, 1) * resting.column_s
    for step in range(3):
        base = still(pose(1e-9 * step, 0.0))
        anna = {"person_anna": still(pose(3.0, 0.5 - 0.2 * step))}
        seen = [result.copy() for result in resting.ranges(base, times, 0, 180, anna)]
        arriving.ranges(still(pose(5.0 + step, 0.0)), times, 0, 180, anna)
        fresh = arriving.ranges(base, times, 0, 180, anna)
        np.testing.assert_allclose(seen[0], fresh[0], atol=1e-6)
    moved = still(pose(0.01, 0.0))
    seen = [result.copy() for result in resting.ranges(moved, times, 0, 180, {})]
    fresh = lidar(file, exact(), people=("person_anna",)).ranges(moved, times, 0, 180, {})
    assert all(np.array_equal(one, other) for one, other in zip(seen, fresh, strict=True)), "a centimetre is a move"


def test_ring_errors_are_within_data_sheet_and_fixed_per_seed() -> None:
    """Level ground: each ring has one height of its own."""
    quiet = {"noise_m": 0.0, "mixed_share": 0.0, "lost_share": 0.0}
    still = {"position_m": 0.0, "rotation_rad": 0.0}
    params = changed(360, ranging={**quiet, "range_bias_m": 0.03, "elevation_bias_deg": 0.1}, mounting=still)
    true = changed(360, ranging={**quiet, **TRUE_RINGS}, mounting=still)

    def off_m(which: LidarParams, seed: int) -> np.ndarray:
        points = lidar(world(), which, seed).sweep(HERE, 0.0).points
        rings = [points["z"][points["ring"] == ring] for ring in range(20)]
        assert max(float(np.ptp(ring)) for ring in rings) < 1e-3, "no column differs"
        return np.array([float(ring.mean()) for ring in rings]) + UP_M

    assert np.abs(off_m(true, 5)).max() < 1e-4
    off = off_m(params, 5)
    assert off.std() > 0.002
    assert np.abs(off).max() < 0.03
    assert np.array_equal(off_m(params, 5), off), "the same sensor"
    assert not np.array_equal(off_m(params, 6), off), "another one"

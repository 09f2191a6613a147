"""The LiDAR's mount from a ride: known errors of tilt, height and heading are found, impossible ones rejected."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot_stack.core.robot import load_robot
from robot_stack.mapping.collector import Collector
from robot_stack.mapping.heading import heading_of, steps_of
from robot_stack.mapping.mount import MountFound, mount_of
from robot_stack.mapping.poses import inverse, planar, rotation_of
from robot_stack.mapping.ride import Ride, RideError
from robot_stack.mapping.tilt import Plane, ground_plane, tilt_of
from tests.unit.mapping import site

SENSOR = np.asarray(load_robot().lidar_xyz_m)


def turned(points: np.ndarray, rpy_deg: tuple[float, float, float]) -> np.ndarray:
    """Returns a sweep of a sensor rotated by ``rpy_deg``, interpreted as if it were not rotated."""
    seen = points.copy()
    xyz = np.stack([points["x"], points["y"], points["z"]], axis=1).astype(np.float64)
    own = Rotation.from_euler("xyz", rpy_deg, degrees=True).inv().apply(xyz)
    seen["x"], seen["y"], seen["z"] = own.T
    return seen


@cache
def ride(rpy_deg: tuple[float, float, float]) -> Ride:
    collector = Collector(site.params().sweeps, load_robot())
    for time_s, points, pose in site.in_order(site.recorded()):
        if pose is None:
            collector.sweep(time_s, turned(points, rpy_deg))
        else:
            collector.odometry(time_s, pose.x, pose.y, pose.yaw)
    return collector.finish()


def found(rpy_deg: tuple[float, float, float]) -> MountFound:
    return mount_of(ride(rpy_deg), site.params(), load_robot())


@pytest.mark.parametrize("rpy_deg", [(1.2, -0.8, 1.5), (-2.0, 1.5, -3.0)])
def test_known_errors_are_found(rpy_deg: tuple[float, float, float]) -> None:
    """A coarse sensor of 880 beams on a circle of 3 m; the wheels report 2 % more distance and a false rotation."""
    mount = found(rpy_deg)
    error = np.subtract(mount.rpy_deg((0.0, 0.0, 0.0)), rpy_deg)
    assert np.abs(error[:2]).max() < 0.15
    assert abs(error[2]) < 0.4
    assert mount.tilt.height_m == pytest.approx(SENSOR[2], abs=0.01)
    # The error fits the reported deviation. The margin is for the motion distortion of a tilted sweep.
    assert np.hypot(*error[:2]) < 3.0 * math.degrees(mount.tilt.deviation_rad) + 0.03
    assert abs(error[2]) < 3.0 * math.degrees(mount.heading.deviation_rad)
    assert mount.heading.scale == pytest.approx(1.0 / (1.0 + site.SCALE_ERROR), abs=0.015)
    assert mount.heading.turn_radpm == pytest.approx(-site.YAW_ERROR_RADPM, abs=0.004)


def test_a_driver_that_turned_the_cloud_already_is_counted_in() -> None:
    before, more = (5.0, -3.0, 90.0), (1.2, -0.8, 1.5)
    both = Rotation.from_euler("xyz", more, degrees=True) * Rotation.from_euler("xyz", before, degrees=True)
    wanted = both.as_euler("xyz", degrees=True)
    assert found(more).rpy_deg(before) == pytest.approx(tuple(wanted), abs=0.4)


def plane(slope: tuple[float, float], yaw: float, rotation: np.ndarray, height_m: float) -> Plane:
    """Returns ground with ``slope`` in odom, as a sensor measures it whose points need ``rotation``."""
    c, s = math.cos(yaw), math.sin(yaw)
    here = np.array([-(c * slope[0] + s * slope[1]), s * slope[0] - c * slope[1], 1.0])
    normal = rotation.T @ (here / np.linalg.norm(here))
    return Plane(normal, float(normal @ SENSOR) - height_m, 0.01)


def test_tilt_is_separated_from_slope_by_turning() -> None:
    rotation, yaw = rotation_of(np.radians([1.0, -2.0, 0.0])), np.linspace(0.0, 2.0 * math.pi, 40)
    tilt = tilt_of([plane((0.05, -0.03), angle, rotation, 0.73) for angle in yaw], yaw, 20.0, SENSOR)
    np.testing.assert_allclose(tilt.rotation, rotation, atol=1e-4)
    assert tilt.height_m == pytest.approx(0.73, abs=1e-3)
    assert tilt.deviation_rad < 1e-3


def test_ramps_on_the_way_are_outliers() -> None:
    rotation, yaw = rotation_of(np.radians([0.5, 0.5, 0.0])), np.linspace(0.0, 6.0 * math.pi, 60)
    planes = [plane((0.17, 0.0) if 20 <= k < 26 else (0.01, 0.0), angle, rotation, 0.7) for k, angle in enumerate(yaw)]
    np.testing.assert_allclose(tilt_of(planes, yaw, 30.0, SENSOR).rotation, rotation, atol=1e-3)


def test_a_ride_without_a_turn_is_refused() -> None:
    whole = ride((1.0, 0.0, 0.0))
    ahead = replace(
        whole.odometry,
        values=np.column_stack([0.8 * whole.odometry.stamp_s, np.zeros((len(whole.odometry.values), 2))]),
    )
    with pytest.raises(RideError, match="does not turn"):
        mount_of(replace(whole, odometry=ahead), site.params(), load_robot())


def test_a_short_ride_and_one_without_ground_are_refused() -> None:
    whole, params = ride((0.0, 0.0, 0.0)), site.params()
    long = params.model_copy(update={"mount": params.mount.model_copy(update={"shortest_m": 100.0})})
    with pytest.raises(RideError, match="too short for the heading"):
        mount_of(whole, long, load_robot())
    aloft = tuple(replace(sweep, points=sweep.points + np.float32([0.0, 0.0, 2.0])) for sweep in whole.sweeps)
    with pytest.raises(RideError, match="sweeps show ground"):
        mount_of(replace(whole, sweeps=aloft), params, load_robot())
    strict = params.model_copy(update={"mount": params.mount.model_copy(update={"deviation_deg": 1e-6})})
    with pytest.raises(RideError, match=r"the deviation of the tilt is .* allowed"):
        mount_of(whole, strict, load_robot())


def test_the_ground_is_found_below_things_and_tilted_by_three_degrees() -> None:
    random = np.random.default_rng(5)
    places = random.uniform(-8.0, 8.0, (4000, 2))
    z = 0.05 * places[:, 0] - 0.02 * places[:, 1] + 0.03 + random.normal(0.0, 0.01, 4000)
    ground = np.column_stack([places, z])
    things = random.uniform((2.0, -3.0, 0.0), (2.5, 3.0, 1.5), (1500, 3))
    seen = ground_plane(np.concatenate([ground, things]), site.params().mount)
    np.testing.assert_allclose(-seen.normal[:2] / seen.normal[2], (0.05, -0.02), atol=2e-3)
    assert seen.offset_m / seen.normal[2] == pytest.approx(0.03, abs=5e-3)


@pytest.mark.parametrize("yaw_deg", [-10.0, 2.0])
def test_the_heading_is_exact_on_exact_ways(yaw_deg: float) -> None:
    """A path with turns, with the sensor off the centre and wheels 1 % too large."""
    yaw, sensor = math.radians(yaw_deg), np.array([0.4, -0.2])
    true = np.array([planar(0.3 * k, 0.5 * math.sin(0.2 * k), 0.1 * k) for k in range(60)])
    wheels = true.copy()
    wheels[:, :2, 3] /= 1.01  # the rotation is correct
    turn = planar(*(sensor - rotation_of(np.array([0.0, 0.0, yaw]))[:2, :2] @ sensor), yaw)
    seen = inverse(turn) @ true @ turn
    pairs = steps_of(wheels, 1.0)
    result = heading_of(seen, wheels, sensor, pairs)
    assert math.degrees(result.yaw_rad) == pytest.approx(yaw_deg, abs=1e-6)
    assert result.scale == pytest.approx(1.01, abs=1e-9)
    assert np.abs(result.residuals_m).max() < 1e-9

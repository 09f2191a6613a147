"""A low sun: false returns at any range in beams near it, and lost true returns."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim.camera.motion import still
from sim.lidar import labels
from sim.lidar.sensor import CLEAR, Conditions, Lidar, Sweep
from sim.lidar.sun import Sun

from .scenes import changed, lidar, pose, world

WALL = {"name": "wall", "x_m": 15.5, "y_m": 0.0, "length_m": 1.0, "width_m": 60.0, "height_m": 20.0}
SUN = Conditions(sun=Sun(30.0))
REACH_DEG = changed().glare.reach_deg


def sensor(walls: bool = False, seed: int = 3) -> Lidar:
    return lidar(world(walls=[WALL] if walls else []), changed(1200), seed)


def xyz_of(sweep: Sweep) -> np.ndarray:
    points = sweep.points
    return np.c_[points["x"], points["y"], points["z"]].astype(float)


def away_deg(xyz: np.ndarray, sun: Sun, yaw_deg: float = 0.0) -> np.ndarray:
    """Returns the angle of each point's beam from the sun, as the sensor sees it."""
    towards = Sun(sun.azimuth_deg - yaw_deg, sun.elevation_deg).direction()
    cosine = xyz @ towards / np.linalg.norm(xyz, axis=1)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


@pytest.mark.parametrize("yaw_deg", [0.0, 120.0])
def test_false_returns_stand_before_the_sun_at_any_range(yaw_deg: float) -> None:
    """The sun keeps its direction in map when the robot turns."""
    sweep = sensor().sweep(still(pose(0.0, 0.0, math.radians(yaw_deg))), 0.0, conditions=SUN)
    false = xyz_of(sweep)[sweep.labels == labels.AIRBORNE]
    assert len(false) > 200
    assert away_deg(false, SUN.sun or Sun(0.0), yaw_deg).max() < REACH_DEG + 0.5, "0.05 deg of mounting, rings' errors"
    far = np.linalg.norm(false, axis=1)
    assert far.min() < 3.0
    assert far.max() > 40.0


def test_a_wall_drowns_into_the_sun_and_nowhere_else_and_is_never_farther() -> None:
    clear, bright = (sensor(walls=True).sweep(still(np.eye(4)), 0.0, conditions=c) for c in (CLEAR, SUN))

    def wall(sweep: Sweep, near: bool) -> int:
        xyz = xyz_of(sweep)[sweep.labels == labels.WALL]
        away = away_deg(xyz, SUN.sun or Sun(0.0))
        return int(((away < 3.0) if near else (away > REACH_DEG + 0.5)).sum())

    assert wall(bright, near=True) < 0.6 * wall(clear, near=True)
    assert wall(bright, near=False) == wall(clear, near=False)


def test_a_seed_is_a_sun_and_leaves_the_sensor_s_own_noise_alone() -> None:
    first, again, other = (sensor(seed=seed).sweep(still(np.eye(4)), 0.0, conditions=SUN) for seed in (5, 5, 6))
    assert np.array_equal(first.points, again.points)
    assert not np.array_equal(first.points, other.points)
    shaded, dazzled = sensor(), sensor()
    shaded.sweep(still(np.eye(4)), 0.0)
    dazzled.sweep(still(np.eye(4)), 0.0, conditions=SUN)
    assert np.array_equal(shaded.sweep(still(np.eye(4)), 0.1).points, dazzled.sweep(still(np.eye(4)), 0.1).points)

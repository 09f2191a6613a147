"""Panes of glass: the sensor reports the pane, the background, or a mirror image behind the pane."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim.camera.motion import still
from sim.lidar import labels
from sim.lidar.glass import mirrored_share
from sim.lidar.sensor import Sweep
from sim.worldfile import WorldFile

from .scenes import AHEAD_M, exact, lidar, world

INDEX = 1.52
PANE = {"name": "pane", "x_m": 4.21, "y_m": 0.0, "length_m": 0.02, "width_m": 6.0, "height_m": 3.0}
BEHIND = {"name": "room", "x_m": 8.5, "y_m": 0.0, "length_m": 1.0, "width_m": 12.0, "height_m": 3.0}
POLE = {"name": "pole", "x_m": 3.0, "y_m": 1.5, "radius_m": 0.2, "height_m": 1.6}
FACE_M = 4.2 - AHEAD_M


def street(behind: bool, glass: bool = True) -> WorldFile:
    walls = [PANE, BEHIND] if behind else [PANE]
    return world(walls=walls, cylinders=[POLE], glass=["pane"] if glass else [])


def look(file: WorldFile, seed: int = 0) -> Sweep:
    return lidar(file, exact(1200), seed).sweep(still(np.eye(4)), 0.0)


def xyz(sweep: Sweep, label: int) -> np.ndarray:
    mine = sweep.points[sweep.labels == label]
    return np.c_[mine["x"], mine["y"], mine["z"]].astype(float)


def test_mirrored_share_of_pane_follows_fresnel_equations() -> None:
    once = ((INDEX - 1.0) / (INDEX + 1.0)) ** 2
    assert mirrored_share(1.0, INDEX) == pytest.approx(2.0 * once / (1.0 + once))
    assert 0.07 < mirrored_share(1.0, INDEX) < 0.09
    shares = [mirrored_share(math.cos(math.radians(angle)), INDEX) for angle in (0.0, 45.0, 60.0, 75.0, 85.0, 89.9)]
    assert shares == sorted(shares)
    assert shares[4] > 0.6
    assert shares[5] > 0.98


def test_most_beams_pass_through_pane_except_near_normal_incidence() -> None:
    sweep = look(street(behind=True))
    wall = xyz(sweep, labels.WALL)
    ahead = wall[(np.abs(wall[:, 1]) < 0.4 * wall[:, 0]) & (wall[:, 2] > -0.6)]
    pane, room = np.abs(ahead[:, 0] - FACE_M) < 0.02, np.abs(ahead[:, 0] - (8.0 - AHEAD_M)) < 0.02
    assert (pane | room).all()
    assert 0.02 < pane.mean() < 0.2
    normal = np.hypot(ahead[:, 1], ahead[:, 2]) < 0.8 * FACE_M * math.tan(math.radians(exact().glass.glint_deg))
    assert normal.any()
    assert pane[normal].mean() > 0.95, "at right angles it shines"


def test_mirror_images_lie_as_far_behind_pane_as_object_in_front() -> None:
    images = xyz(look(street(behind=False)), labels.MIRROR)
    assert (images[:, 0] > FACE_M).all()
    back = np.c_[2.0 * FACE_M - images[:, 0], images[:, 1], images[:, 2]]
    ground = np.abs(back[:, 2] + 0.7) < 1e-3
    pole = np.abs(np.hypot(back[:, 0] - (3.0 - AHEAD_M), back[:, 1] - 1.5) - 0.2) < 1e-3
    assert (ground | pole).all(), "the street's ground and its pole, and nothing else"
    assert pole.sum() > 15


def test_a_world_without_glass_is_as_it_was_and_a_seed_is_a_pane() -> None:
    opaque = look(street(behind=True, glass=False))
    assert len(xyz(opaque, labels.MIRROR)) == 0
    assert xyz(opaque, labels.WALL)[:, 0].max() < 8.0 - AHEAD_M + 0.01
    first, again, other = (look(street(behind=True), seed) for seed in (4, 4, 5))
    assert np.array_equal(first.points, again.points)
    assert not np.array_equal(first.points, other.points)


def test_only_walls_and_boxes_can_be_of_glass() -> None:
    with pytest.raises(match="glass: no wall or box pole"):
        world(cylinders=[POLE], glass=["pole"])

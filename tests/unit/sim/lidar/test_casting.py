"""Ray casting, compared with the rays of the physics engine and with expected views of hand-made worlds."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot_stack.core.geometry import Pose2, Twist2
from sim.camera.motion import Track, still
from sim.lidar import labels
from sim.lidar.kernels import FIRST_SOLID
from sim.lidar.poses import poses_at
from sim.lidar.views import moving, sweep_at
from sim.plant.world import Setup, World
from sim.worldfile import load_world

from .scenes import AHEAD_M, ROBOT, SIM, UP_M, exact, lidar, pose, world

COLUMNS = 600


@pytest.mark.parametrize("name", ["yard", "ramps"])
def test_ranges_are_those_of_the_physics(name: str) -> None:
    """Every beam of moving and tilted sweeps against mj_multiRay, without pits and the castors' spheres."""
    file = load_world(name).model_copy(update={"pits": [], "floor": world().floor})
    physics = World(ROBOT, SIM, Setup(file, 0, Pose2(3.0, 0.0, 0.0), wheelchair_pose=Pose2(6.0, 1.0, 0.3)))
    spheres = physics.model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE
    physics.model.geom_group[spheres] = 2
    physics.model.geom_size[physics.model.geom("ground").id, :2] = 200.0
    sensor = lidar(file, exact(COLUMNS))
    chair = still(physics.wheelchair_pose())
    castors = np.flatnonzero(sensor.scene.label == labels.CHAIR)[-4:]
    random = np.random.default_rng(1)
    times = np.arange(1 - COLUMNS, 1) * sensor.column_s
    met: set[int] = set()
    for _ in range(3):
        tilt = random.uniform(-0.15, 0.15, 2)
        base = pose(*random.uniform((1.0, -1.5), (9.0, 2.5)), random.uniform(-3, 3), *tilt, random.uniform(0.0, 0.3))
        track = moving(base, Twist2(1.0, 0.5, 1.0), 0.1)
        found, hits, _ = sensor.ranges(track, times, 0, COLUMNS, {"wheelchair": chair})
        place, turn = poses_at(track, times, sensor.mounting)
        azimuth = math.pi - 2.0 * math.pi * np.arange(COLUMNS) / COLUMNS
        elevation = np.radians(np.linspace(-30.0, 15.0, 64))
        for column in range(0, COLUMNS, 3):
            flat = np.cos(elevation)
            beams = np.c_[flat * np.cos(azimuth[column]), flat * np.sin(azimuth[column]), np.sin(elevation)]
            there, what = np.zeros(64), np.zeros(64, np.int32)
            groups = np.array([1, 0, 0, 1, 0, 0], np.uint8)
            rays = (beams @ turn[column].T).ravel()
            mujoco.mj_multiRay(
                physics.model, physics.data, place[column].copy(), rays, groups, 1, -1, what, there, None, 64, 60.0
            )
            there[(there < 0.0) | (there > 50.0)] = np.inf
            here = found[column].astype(float)
            there[np.isinf(there)] = here[np.isinf(here)] = 1e3
            assert np.abs(here - there)[~np.isin(hits[column], castors)].max() < 1e-3
        met |= set(sensor.scene.label[hits[hits >= 0]].tolist())
    assert met >= {labels.GROUND, labels.RAMP, labels.KERB, labels.WALL, labels.CHAIR}


def test_a_wall_ahead_is_where_it_stands() -> None:
    file = world(walls=[{"name": "wall", "x_m": 6.0, "y_m": 0.0, "length_m": 2.0, "width_m": 8.0, "height_m": 3.0}])
    points, found = sweep_at(file, np.eye(4), params=exact())
    wall = points[found == labels.WALL]
    assert len(wall) > 500
    assert np.allclose(wall["x"], 5.0 - AHEAD_M, atol=1e-5), "only its near face is seen"
    assert abs(wall["y"]).max() <= 4.0
    ground = points[found == labels.GROUND]
    assert np.allclose(ground["z"], -UP_M, atol=1e-5)
    assert np.allclose(ground["intensity"] / 255.0, 0.17 * UP_M / np.linalg.norm(_xyz(ground), axis=1), atol=0.06)


def _xyz(points: np.ndarray) -> np.ndarray:
    return np.c_[points["x"], points["y"], points["z"]].astype(float)


def test_a_kerb_returns_from_its_face_and_its_top() -> None:
    height_m = 0.08
    kerb = {"name": "kerb", "x_m": 3.0, "y_m": 0.0, "length_m": 0.3, "width_m": 3.0, "height_m": height_m}
    points, found = sweep_at(world(kerbs=[kerb]), np.eye(4), params=exact())
    mine = points[found == labels.KERB]
    face = abs(mine["x"] - (2.85 - AHEAD_M)) < 1e-4
    assert face.sum() > 10
    assert (~face).sum() > 10
    assert np.allclose(mine["z"][~face], height_m - UP_M, atol=1e-4)


def test_a_pit_shows_its_floor_and_its_far_side() -> None:
    pit = {"name": "pit", "x_m": 3.0, "y_m": 0.0, "length_m": 2.0, "width_m": 4.0, "depth_m": 0.3}
    points, found = sweep_at(world(pits=[pit]), np.eye(4), params=exact())
    mine = points[found == labels.PIT]
    floor = abs(mine["z"] - (-UP_M - 0.3)) < 1e-4
    far = abs(mine["x"] - (4.0 - AHEAD_M)) < 1e-4
    assert (floor.sum() > 20, far.sum() > 20) == (True, True)
    # The edge hides the floor behind it: from 0.7 m up at 1.8 m distance, a beam falls 0.3 m within 0.77 m.
    assert mine["x"][floor].min() > 2.0 - AHEAD_M + 0.75
    sides = abs(abs(mine["y"]) - 2.0) < 1e-4
    assert (floor | far | sides).all()
    level = points[found == labels.GROUND]
    assert not ((abs(level["x"] + AHEAD_M - 3.0) < 0.99) & (abs(level["y"]) < 1.99)).any()


def test_people_and_the_chair_are_seen_where_they_are() -> None:
    points, found = sweep_at(
        world(), np.eye(4), people=[Pose2(4.0, 1.0, 0.5)], chair=pose(0.95, 0.0), params=exact(1200)
    )
    person = _xyz(points[found == labels.PERSON])
    assert np.linalg.norm(person[:, :2] - (4.0 - AHEAD_M, 1.0), axis=1).max() < 0.3
    assert person[:, 2].max() == pytest.approx(1.75 - UP_M, abs=0.06)
    chair = _xyz(points[found == labels.CHAIR])
    assert chair[:, 0].min() < 0.95 + 0.04 - AHEAD_M, "an attached chair's board is right before the sensor"
    assert chair[:, 2].max() > 0.92 - UP_M, "somebody sits in it, higher than its back"


def test_columns_see_from_where_the_sensor_was() -> None:
    """Turning at 1 rad/s beside a wall bends the raw points. Each point's own pose flattens them again."""
    file = world(walls=[{"name": "wall", "x_m": 0.0, "y_m": 3.5, "length_m": 30.0, "width_m": 1.0, "height_m": 3.0}])
    twist = Twist2(0.5, 0.0, 1.0)
    points, found = sweep_at(file, np.eye(4), twist=twist, params=exact())
    wall = points[found == labels.WALL]
    assert np.ptp(wall["y"]) > 0.2, "the wall is bent as measured"
    columns, which = np.unique(wall["time"], return_inverse=True)
    own = np.array([_at(twist, float(time)) @ pose(AHEAD_M, 0.0, z=UP_M) for time in columns])[which]
    upright = np.einsum("nij,nj->ni", own[:, :3, :3], _xyz(wall)) + own[:, :3, 3]
    assert np.allclose(upright[:, 1], 3.0, atol=1e-3)


def _at(twist: Twist2, time_s: float) -> np.ndarray:
    """Returns the pose at ``time_s`` of a body that is at the origin at time 0, by hand on its circle."""
    angle, radius = twist.omega * time_s, twist.vx / twist.omega
    return pose(radius * math.sin(angle), radius * (1.0 - math.cos(angle)), angle)


def test_movers_move_while_the_sensor_turns() -> None:
    sensor = lidar(world(), exact(1200), people=("person_a",))
    times = np.array([-0.1, 0.0])
    walk = Track(times, np.array([pose(-2.0, 0.0), pose(-1.8, 0.0)]))
    sweep = sensor.sweep(still(np.eye(4)), 0.0, {"person_a": walk})
    person = sweep.points[sweep.labels == labels.PERSON]
    early = person[person["time"] < -0.08]
    late = person[person["time"] > -0.02]
    high = 0.3  # the trunk
    assert late["x"][late["z"] > high].max() - early["x"][early["z"] > high].max() == pytest.approx(0.2, abs=0.03)


def test_poses_at_agrees_with_the_track() -> None:
    random = np.random.default_rng(0)
    for count in (1, 2, 3, 6):
        poses = np.array([pose(*random.normal(size=2), *random.uniform(-3, 3, 3)) for _ in range(count)])
        track = Track(np.cumsum(random.uniform(0.01, 0.05, count)), poses)
        mounted = pose(0.2, 0.1, 0.3, 0.1)
        times = np.sort(random.uniform(0.0, track.times_s[-1] + 0.02, 50))
        place, turn = poses_at(track, times, mounted)
        wanted = track.at(times) @ mounted
        assert np.allclose(place, wanted[:, :3, 3], atol=1e-9)
        assert np.allclose(Rotation.from_matrix(turn).as_matrix(), wanted[:, :3, :3], atol=1e-7)


def test_solids_are_counted_behind_the_ground() -> None:
    file = world(cylinders=[{"name": "pole", "x_m": 3.0, "y_m": 0.0, "radius_m": 0.5, "height_m": 2.0}])
    scene = lidar(file, exact()).scene
    assert scene.label[FIRST_SOLID] == labels.CYLINDER

"""The wheelchair as a separate body: its pose, its brake, and what it obstructs."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import IDENTITY, Pose2, Twist2, quaternion_from_yaw
from sim.plant.imu import ImuSample
from sim.plant.simulation import Simulation
from sim.plant.terrain import BOARD_HALF_M
from sim.plant.world import Setup, World
from sim.worldfile import load_world

from .bench import PARAMS, ROBOT, Bench

DOCKS = load_docks().docks
DOCK_POSE = DOCKS["chair_1"].dock_pose.pose()
CHAIR = DOCK_POSE.inverse()


def make(chair: Pose2 | None, start: Pose2 = IDENTITY, passenger_kg: float = 75.0, **more: float) -> Bench:
    setup = Setup(load_world("flat"), 1, start, wheelchair_pose=chair, passenger_mass_kg=passenger_kg, **more)  # type: ignore[arg-type]
    return Bench(World(ROBOT, PARAMS, setup))


def place_of(world: World) -> np.ndarray:
    pose = world.wheelchair_pose()
    assert pose is not None
    return pose


def test_the_yard_has_a_chair_and_a_charger_where_the_docks_expect_them() -> None:
    file = load_world("yard")
    world = World(ROBOT, PARAMS, Setup(file, 1, file.start.pose()))
    bodies = dict(world.bodies())
    assert list(bodies) == ["base_link", "wheelchair", "charger"]
    for frame, name in (("wheelchair", "chair_1"), ("charger", "charger")):
        x, y = bodies[frame][:2]
        yaw = 2.0 * math.atan2(bodies[frame][6], bodies[frame][3])
        docked = Pose2(float(x), float(y), yaw).compose(DOCKS[name].dock_pose.pose())
        staging = DOCKS[name].staging.pose()
        assert staging.distance_to(docked) == pytest.approx(1.5, abs=0.1)
        assert abs(staging.relative_to(docked).yaw) < math.radians(4.0), "people put a chair down a little askew"


def test_setup_sets_wheelchair_pose_and_passenger_mass() -> None:
    file = load_world("yard")
    setup = Setup(file, 1, file.start.pose(), wheelchair_pose=Pose2(3.0, 0.5, 0.3), passenger_mass_kg=90.0)
    world = World(ROBOT, PARAMS, setup)
    pose = dict(world.bodies())["wheelchair"]
    _, _, z, w = quaternion_from_yaw(0.3)
    assert pose == pytest.approx([3.0, 0.5, 0.0, w, 0.0, 0.0, z])
    assert world.model.body("wheelchair").mass[0] == pytest.approx(ROBOT.chair_mass_kg + 90.0)


def test_a_world_without_a_chair_shows_none() -> None:
    bench = make(None)
    assert [name for name, _ in bench.world.bodies()] == ["base_link"]
    assert bench.world.wheelchair_pose() is None
    assert bench.world.contact_force_n() == 0.0
    with pytest.raises(ValueError, match="no wheelchair"):
        bench.world.dock_error(DOCK_POSE)


def test_charger_board_lies_at_dock_frame() -> None:
    """A ray from 1 m in front of the board, at its middle height, hits it at the frame's x = 0."""
    file = load_world("yard")
    world = World(ROBOT, PARAMS, Setup(file, 1, Pose2(5.0, 0.0, 0.0)))
    pose = file.stations["charger"].pose()
    eye = pose.compose(Pose2(-1.0, 0.2, 0.0))
    hit = np.zeros(1, np.int32)
    groups = np.array([1, 0, 0, 0, 0, 0], np.uint8)
    ahead = np.array([math.cos(pose.yaw), math.sin(pose.yaw), 0.0])
    distance = mujoco.mj_ray(world.model, world.data, np.array([eye.x, eye.y, 0.45]), ahead, groups, 1, -1, hit)
    assert distance == pytest.approx(1.0, abs=1e-6)
    assert world.model.geom(int(hit[0])).name == "charger"
    wall = next(item for item in file.walls if item.name == "depot")
    assert pose.x - 2.0 * BOARD_HALF_M[0] >= wall.x_m + 0.5 * wall.length_m, "before the wall, not in it"


@pytest.mark.parametrize(("passenger_kg", "towards"), [(0.0, 0.0), (120.0, 0.5 * math.pi), (120.0, math.pi)])
def test_braked_it_stands_on_3_degrees(passenger_kg: float, towards: float) -> None:
    bench = make(
        Pose2(3.0, 0.0, 0.5),
        passenger_kg=passenger_kg,
        slope_rad=math.radians(3.0),
        slope_direction_rad=towards,
    )
    bench.run(0.5)
    before = place_of(bench.world)
    bench.run(2.0)
    assert np.abs(place_of(bench.world) - before).max() < 0.1e-3


def test_without_its_brake_it_would_roll() -> None:
    """Drag 0.02 against 3 degrees: (sin 3 - 0.02 cos 3) g = 0.32 m/s2, so 0.16 m in 1 s."""
    bench = make(Pose2(3.0, 0.0, 0.0), slope_rad=math.radians(3.0))
    assert bench.world.chair is not None
    bench.world.chair.set_brake(False)
    bench.run(1.0)
    assert 3.0 - place_of(bench.world)[0, 3] == pytest.approx(0.16, abs=0.02)


@pytest.mark.parametrize(("off_m", "off_yaw_deg"), [((0.01, 0.01), -1.0), ((0.01, -0.01), 1.0), ((-0.01, 0.01), 1.0)])
def test_nothing_touches_where_the_latch_can_take_it(off_m: tuple[float, float], off_yaw_deg: float) -> None:
    bench = make(CHAIR, start=Pose2(*off_m, math.radians(off_yaw_deg)))
    bench.run(0.1)
    assert bench.world.contact_force_n() == 0.0
    assert bench.world.dock_error(DOCK_POSE) == pytest.approx((*off_m, math.radians(off_yaw_deg)), abs=1e-4)


def test_the_robot_pushes_it_with_effort() -> None:
    """105 kg on a brake of 0.5 need 515 N, which the latch's plates apply to the rails 20 mm before the dock pose,
    once the safety edge on them is compressed by 30 mm. No engine stops this robot.
    """
    bench = make(CHAIR)
    bench.servo()
    forces: list[float] = []
    bench.drive(Twist2(0.1, 0.0, 0.0))
    bench.run(2.0, lambda: forces.append(bench.world.contact_force_n()))
    assert place_of(bench.world)[0, 3] > CHAIR.x + 0.03
    assert bench.world.dock_error(DOCK_POSE)[0] == pytest.approx(0.050, abs=0.003)
    assert np.mean(forces[-500:]) == pytest.approx(0.5 * 105.0 * 9.81, rel=0.25)


def test_dock_error_is_seen_from_the_chair() -> None:
    """The chair at (2, 1) faces +y; docked, the robot is at (2, 0.05). It is 3 cm short and 2 cm to the right."""
    bench = make(Pose2(2.0, 1.0, 0.5 * math.pi), start=Pose2(2.02, 0.02, 0.5 * math.pi + 0.1))
    along, across, yaw = bench.world.dock_error(DOCK_POSE)
    assert (along, across, yaw) == pytest.approx((-0.03, -0.02, 0.1), abs=1e-6)
    assert -DOCK_POSE.x == pytest.approx(ROBOT.latch.x_m + PARAMS.wheelchair.rail_length_m)
    assert (DOCK_POSE.y, DOCK_POSE.yaw) == (0.0, 0.0)


def test_robot_and_chair_fit_into_the_footprint_with_chair() -> None:
    setup = Setup(load_world("flat"), 1, IDENTITY, attached_at_start=True)
    world = World(ROBOT, PARAMS, setup)
    limits = ROBOT.footprint_with_chair
    model, data = world.model, world.data
    for geom in range(model.ngeom):
        if model.geom_bodyid[geom] == 0 or not model.geom_contype[geom]:
            continue
        turned = np.abs(data.geom_xmat[geom].reshape(3, 3))
        size = model.geom_size[geom]
        half = np.full(3, size[0]) if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_SPHERE else turned @ size
        low, high = data.geom_xpos[geom] - half, data.geom_xpos[geom] + half
        name = model.geom(geom).name
        assert low[0] >= limits.rear_m - 1e-9, name
        assert high[0] <= limits.front_m + 1e-9, name
        assert max(high[1], -low[1]) <= 0.5 * limits.width_m + 1e-9, name


def test_the_rails_cover_no_marker() -> None:
    """From any camera position on the approach, rails and castors are below and beside every marker."""
    chair, size = PARAMS.wheelchair, load_docks().marker_size_m
    lowest = min(place.z_m for place in DOCKS["chair_1"].markers.values()) - 0.5 * size
    widest = max(abs(place.y_m) for place in DOCKS["chair_1"].markers.values()) + 0.5 * size
    assert max(chair.rail_top_m, 2.0 * chair.castor_radius_m) < lowest
    assert chair.rail_inner_m > widest
    assert chair.board_width_m >= 2.0 * widest


def test_inclined_ground_tilts_gravity_and_imu_readings() -> None:
    """3 degrees rising towards +y, robot facing +x: it leans to its right by 3 degrees; a = g (0, sin 3, cos 3)."""
    slope = math.radians(3.0)
    setup = Setup(load_world("flat"), 1, IDENTITY, slope_rad=slope, slope_direction_rad=0.5 * math.pi)
    assert setup.gravity_mps2() == pytest.approx((0.0, -9.81 * math.sin(slope), -9.81 * math.cos(slope)))
    sim = Simulation(ROBOT, PARAMS, setup)
    samples: list[ImuSample] = []
    for _ in range(1000):
        sample = sim.step()
        if sample is not None:
            samples.append(sample)
    measured = np.mean([sample.acceleration_mps2 for sample in samples[30:]], axis=0)
    assert measured == pytest.approx([0.0, 9.81 * math.sin(slope), 9.81 * math.cos(slope)], abs=0.08)
    x, y, z, w = samples[-1].orientation_xyzw
    roll, pitch = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), math.asin(2 * (w * y - z * x))
    assert (roll, pitch) == pytest.approx((slope, 0.0), abs=4 * PARAMS.imu.attitude_error_rad)
    for bad in (math.nan, 1.6):
        with pytest.raises(ValueError, match="slope_rad"):
            make(None, slope_rad=bad)

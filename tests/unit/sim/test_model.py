"""The model has the masses and geometry of the configuration, and the ground is as in the world file."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from robot_stack.contract.frames import JOINTS, MODULES
from robot_stack.core.config import validate
from robot_stack.core.robot import Robot
from sim.plant.inertia import box_diagonal, chassis_inertial, wheelchair_inertial
from sim.plant.model import write_mjcf
from sim.plant.robot_model import nominal_tolerances
from sim.worldfile import load_world

from .bench import PARAMS, ROBOT, make_bench


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    text = write_mjcf(ROBOT, PARAMS, load_world("flat"), nominal_tolerances(ROBOT), wheelchair=False)
    return mujoco.MjModel.from_xml_string(text)


def test_masses_are_the_configured_ones(model: mujoco.MjModel) -> None:
    assert mujoco.mj_getTotalmass(model) == pytest.approx(ROBOT.mass_kg)
    for name in MODULES:
        assert model.body(f"{name}_wheel").mass[0] == pytest.approx(ROBOT.wheel_mass_kg)
        assert model.body(f"{name}_steer").mass[0] == pytest.approx(ROBOT.steer_mass_kg)


def test_wheels_stand_at_the_corners_and_touch_the_ground(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    centre = data.subtree_com[model.body("base").id]
    assert centre == pytest.approx([0.0, 0.0, ROBOT.centre_of_gravity_height_m], abs=1e-9)
    half_sink = 0.5 * PARAMS.physics.contact_sink_m
    for name, (x, y) in zip(MODULES, ROBOT.module_positions_m(), strict=True):
        assert data.body(f"{name}_wheel").xpos == pytest.approx([x, y, ROBOT.wheel_radius_m])
        rim, half_width, _ = model.geom(f"{name}_wheel").size
        assert rim - half_sink == pytest.approx(ROBOT.wheel_radius_m)
        assert half_width == pytest.approx(0.5 * ROBOT.wheel_width_m)


def test_joints_turn_about_the_right_axes(model: mujoco.MjModel) -> None:
    assert [model.actuator(i).name for i in range(model.nu)] == list(JOINTS), "in the order of the axes"
    for joint in JOINTS:
        axis = [0, 1, 0] if joint.endswith("_drive") else [0, 0, 1]
        assert model.joint(joint).axis == pytest.approx(axis)
        assert not model.jnt_limited[model.joint(joint).id], "steering and wheels turn without end"


def test_weight_rests_on_four_wheels_alike() -> None:
    bench = make_bench()
    bench.run(1.0)
    quarter = ROBOT.mass_kg * 9.81 / 4
    assert bench.world.normal_forces_n() == pytest.approx([quarter] * 4, rel=0.02)
    sinks = [-contact.dist for contact in bench.world.data.contact]
    assert sinks == pytest.approx([PARAMS.physics.contact_sink_m] * 4, rel=0.05)


def test_the_robot_never_touches_itself() -> None:
    bench = make_bench(passenger_kg=60.0)
    bench.servo()
    bench.turn_modules(np.array([1.5, -1.5, 0.7, -0.7]))
    model, own = bench.world.model, set()
    for contact in bench.world.data.contact:
        own.add((int(model.geom_bodyid[contact.geom1]), int(model.geom_bodyid[contact.geom2])))
    assert own
    assert all(0 in pair for pair in own), "every contact has the ground on one side"


def test_chair_and_passenger_add_up() -> None:
    """30 kg at 0.40 m and 90 kg at 0.65 m: 120 kg at 0.5875 m."""
    inertial = wheelchair_inertial(ROBOT, PARAMS.wheelchair, 90.0)
    assert inertial.mass_kg == pytest.approx(120.0)
    assert inertial.centre_m == pytest.approx((PARAMS.wheelchair.centre_of_gravity_x_m, 0.0, 0.5875))
    assert inertial.diagonal_kgm2[2] < inertial.diagonal_kgm2[1]
    # 12 kg, 1 x 2 x 3 m: m/12 (4 + 9) = 13, m/12 (1 + 9) = 10, m/12 (1 + 4) = 5.
    assert box_diagonal(12.0, (1.0, 2.0, 3.0)) == pytest.approx((13.0, 10.0, 5.0))


def test_passenger_mass_changes_while_the_world_runs() -> None:
    bench = make_bench(passenger_kg=0.0)
    bench.run(0.2)
    before = mujoco.mj_getTotalmass(bench.world.model)
    bench.world.set_passenger_mass(120.0)
    bench.run(0.2)
    assert before == pytest.approx(ROBOT.mass_kg + ROBOT.chair_mass_kg)
    assert mujoco.mj_getTotalmass(bench.world.model) == pytest.approx(before + 120.0)
    assert abs(bench.twist().vx) < 0.01
    for mass in (-1.0, 121.0, math.nan):
        with pytest.raises(ValueError, match="passenger_mass_kg"):
            bench.world.set_passenger_mass(mass)
    with pytest.raises(ValueError, match="no wheelchair"):
        make_bench().world.attach_wheelchair(50.0)


def test_chair_is_attached_in_motion_and_detached() -> None:
    bench = make_bench(passenger_kg=50.0)
    bench.world.detach_wheelchair()
    bench.servo()
    bench.ramp(0.5 / ROBOT.wheel_radius_m, 1.0)
    chair = bench.world.data.body("wheelchair")
    assert not bench.world.attached
    bench.world.attach_wheelchair(80.0)
    bench.run(1.0)
    gap = chair.xpos[0] - bench.world.truth().position_m[0]
    assert bench.world.attached
    assert gap == pytest.approx(0.95, abs=0.001), "latch 0.50 m ahead, rails of 0.45 m more"
    assert bench.twist().vx == pytest.approx(0.5, abs=0.03)
    place = chair.xpos[0]
    bench.world.detach_wheelchair()
    bench.ramp(0.0, 2.0)
    # 0.5 m/s against its parking brake: v^2 / (2 x 0.5 g) = 25 mm.
    assert 0.005 < chair.xpos[0] - place < 0.05


@pytest.mark.parametrize(
    ("change", "says"),
    [({"mass_kg": 25.0}, "leaves nothing for the chassis"), ({"centre_of_gravity_height_m": 0.05}, "outside its box")],
)
def test_a_chassis_that_cannot_be_is_refused(change: dict[str, float], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        chassis_inertial(validate(Robot, {**ROBOT.model_dump(), **change}, "test"), PARAMS)

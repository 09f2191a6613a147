"""The arm as a machine: its size, gripper, match with the engine's configuration, and faults."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.optimize import least_squares

from robot_stack.core.config import load
from robot_stack.supervisor.profile import load_plan
from robot_stack.wmx.config import EngineConfig, load_engine_config
from sim.arm.faults import FAULT_KINDS, JOINTS
from sim.arm.params import ArmParams, disagreement
from sim.arm.world import ArmWorld
from sim.plant.fault_table import FaultRefused, FaultTable
from tests.unit.sim.arm.rig import DT_S, STRETCHED, ArmRig, arm_params


@pytest.fixture
def engine_config() -> EngineConfig:
    return load(EngineConfig, "wmx_engine_manipulator")


def test_the_shipped_arm_fits_the_shipped_engine(engine_config: EngineConfig) -> None:
    assert disagreement(arm_params(), engine_config) == ""
    assert arm_params().names == tuple(axis.name for axis in engine_config.axes) == JOINTS
    general = load_plan("manipulator").parameters["wmx_ros2_general_node"]
    assert general["rated_torque_nm"] == [arm_params().kind(axis).rated_torque_nm for axis in range(len(JOINTS))]
    assert general["axis_count"] == len(JOINTS)


def test_an_engine_with_another_polarity_or_gear_is_named(engine_config: EngineConfig) -> None:
    elbow = engine_config.kinds["elbow"]
    turned = engine_config.model_copy(
        update={"kinds": {**engine_config.kinds, "elbow": elbow.model_copy(update={"polarity": -1})}}
    )
    assert disagreement(arm_params(), turned).startswith("joint3: the encoder has 42467328 counts, direction 1")
    assert disagreement(arm_params(), load_engine_config()) == "axes: the arm has 6, the engine 8"


def test_reach_and_mass_are_those_of_its_class() -> None:
    rig = ArmRig(start_rad=STRETCHED, cube=None)
    tool = rig.arm.data.site("tool").xpos
    assert tool[0] == pytest.approx(0.62)
    masses = rig.params.body.mass_kg
    arm_kg = sum(masses.model_dump().values())
    assert arm_kg == pytest.approx(16.5)
    gripper_kg = rig.params.gripper.mass_kg + 2.0 * rig.params.gripper.finger_mass_kg
    assert float(sum(rig.arm.model.body_mass)) == pytest.approx(arm_kg + gripper_kg, abs=1e-4)


def test_encoder_counts_have_the_gear_and_the_direction_of_each_joint() -> None:
    start = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    rig = ArmRig(start_rad=start)
    rig.cycle()
    turn = 2.0 * np.pi
    expected = [-52953088 * 0.1, -52953088 * 0.2, 42467328 * 0.3, *(-42467328 * rad for rad in start[3:])]
    np.testing.assert_allclose(rig.inp.position_counts, np.array(expected) / turn, atol=100.0)  # 1e-5 rad
    assert rig.inp.position_counts[0] == pytest.approx(-842775, abs=100)


def test_fingers_move_at_their_speed_and_the_bit_decides() -> None:
    rig = ArmRig()
    stroke, speed = rig.params.gripper.stroke_m, rig.params.gripper.speed_mps
    rig.out.outputs[0] = 1
    rig.run(0.5 * stroke / speed)
    assert rig.arm.truth().positions[6:] == pytest.approx([0.5 * stroke] * 2, abs=0.003)
    rig.run(0.5 * stroke / speed + 0.1)
    assert rig.arm.truth().positions[6:] == pytest.approx([stroke] * 2, abs=1e-3)
    rig.out.outputs[0] = 0b11111110  # other bits are ignored
    rig.run(stroke / speed + 0.1)
    assert rig.arm.truth().positions[6:] == pytest.approx([0.0, 0.0], abs=1e-3)


def test_gripper_grasps_lifts_and_releases_cube() -> None:
    rig = ArmRig().on()
    cube = rig.params.cube
    assert cube is not None
    place = np.array([cube.x_m, cube.y_m, 0.3 * cube.edge_m])
    above = joints_of(rig.arm, place + np.array([0.0, 0.0, 0.1]), np.array([0.0, 0.5, 1.0, 0.0, -1.57, 0.0]))
    at = joints_of(rig.arm, place, above)
    rig.go(above, 1.5)
    rig.go(at, 0.8)
    rig.out.outputs[0] = 1
    rig.run(0.5)
    assert (rig.arm.truth().positions[6:] < 0.03).all()  # the cube keeps the fingers apart
    rig.go(above, 0.8)
    assert rig.arm.cube_position_m()[2] == pytest.approx(0.1 + 0.5 * cube.edge_m, abs=0.02)
    rig.out.outputs[0] = 0
    rig.run(0.8)
    assert rig.arm.cube_position_m()[2] == pytest.approx(0.5 * cube.edge_m, abs=0.002)
    assert not rig.inp.alarm_code.any()


def joints_of(arm: ArmWorld, tool_m: np.ndarray, guess: np.ndarray) -> np.ndarray:
    """Returns joint angles that place the tool there, pointing down, fingers along the base's axes."""
    data = mujoco.MjData(arm.model)

    def miss(joints: np.ndarray) -> np.ndarray:
        data.qpos[:6] = joints
        mujoco.mj_kinematics(arm.model, data)
        site = data.site("tool")
        turned = site.xmat.reshape(3, 3)
        return np.concatenate([10.0 * (site.xpos - tool_m), turned[:, 1] - [0.0, 0.0, -1.0], turned[[0, 2], 0]])

    found = least_squares(miss, guess)
    assert found.cost < 1e-9
    return np.asarray(found.x)


@pytest.mark.parametrize("kind", FAULT_KINDS, ids=lambda kind: kind.name)
def test_every_fault_can_be_raised_and_cleared(kind: object) -> None:
    arm = ArmWorld(arm_params(), DT_S)
    table = FaultTable(arm, arm.fault_kinds)
    target = "joint2" if kind.targets != ("",) else ""  # type: ignore[attr-defined]
    assert table.inject(kind.name, target)  # type: ignore[attr-defined]
    assert len(table.active) == 1
    assert table.inject("clear").startswith(f"cleared {kind.name}")  # type: ignore[attr-defined]
    assert not table.active
    with pytest.raises(FaultRefused, match="target must be one of"):
        table.inject(kind.name, "joint7")  # type: ignore[attr-defined]
    with pytest.raises(FaultRefused):
        table.inject(kind.name, target, -1e9)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"start_rad": (0.0, 0.0, 3.0, 0.0, 0.0, 0.0)}, "start_rad.2: 3.0 is outside -2.7 to 2.7"),
        ({"start_rad": (0.0,) * 5}, "at least 6"),
        ({"payload_kg": float("nan")}, "finite"),
    ],
)
def test_wrong_parameters_are_refused(change: dict[str, object], said: str) -> None:
    good = arm_params().model_dump()
    with pytest.raises(ValueError, match=said):
        ArmParams.model_validate({**good, **change})

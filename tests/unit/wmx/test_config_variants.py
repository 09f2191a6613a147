"""The parameter files of the machines: exactly the documented keys, read as ROS reads them, valid for the nodes."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from typing import Any

import pytest
from rclpy.parameter import parameter_dict_from_yaml_file, parameter_value_to_python

from robot_stack.core.config import Config, config_dir, read_yaml, validate
from robot_stack.wmx.config import EngineConfig
from robot_stack.wmx.differential.params import DiffDriveParams
from robot_stack.wmx.manipulator.params import ManipulatorStateParams
from robot_stack.wmx.trajectory.params import TrajectoryServerParams

ARM_FILES = ("intel_manipulator_config_cr3a", "orin_manipulator_config_cr3a")
# The parameters that the interface documents give each node.
DOCUMENTED: dict[str, set[str]] = {
    "manipulator_state": {
        "joint_number",
        "joint_feedback_rate",
        "gripper_open_value",
        "gripper_close_value",
        "joint_name",
        "encoder_joint_topic",
        "isaacsim_joint_topic",
        "gazebo_joint_topic",
        "wmx_param_file_path",
    },
    "follow_joint_trajectory_server": {"joint_number", "joint_trajectory_action", "wmx_gripper_topic"},
    "diff_drive_controller": {
        "left_axis",
        "right_axis",
        "rate",
        "acc_time",
        "dec_time",
        "wheel_radius",
        "wheel_to_wheel",
        "cmd_vel_topic",
        "encoder_vel_topic",
        "encoder_omega_topic",
        "encoder_odometry_topic",
        "wmx_param_file_path",
    },
}
MODELS: dict[str, type[Config]] = {
    "manipulator_state": ManipulatorStateParams,
    "follow_joint_trajectory_server": TrajectoryServerParams,
    "diff_drive_controller": DiffDriveParams,
}
IN_FILES = [(file, node) for file in ARM_FILES for node in ("manipulator_state", "follow_joint_trajectory_server")] + [
    ("diff_drive_controller_config", "diff_drive_controller")
]


def parameters(file: str, node: str) -> dict[str, Any]:
    """Returns the parameters as rcl reads them from ``--params-file``."""
    path = config_dir() / "wmx" / f"{file}.yaml"
    found = parameter_dict_from_yaml_file(str(path), target_nodes=[node])
    return {name: parameter_value_to_python(item.value) for name, item in found.items()}


def loaded(file: str, node: str) -> Any:
    """Returns the node's parameters with the file applied, as the node builds them."""
    base = read_yaml(config_dir() / f"{node}.yaml")
    return validate(MODELS[node], {**base, **parameters(file, node)}, file)


@pytest.mark.parametrize(("file", "node"), IN_FILES)
def test_loaded_parameters_equal_file_values(file: str, node: str) -> None:
    params = loaded(file, node)
    assert parameters(file, node).keys() == DOCUMENTED[node] <= MODELS[node].model_fields.keys()
    assert read_yaml(config_dir() / "wmx" / f"{file}.yaml").keys() <= DOCUMENTED.keys()
    for name, value in parameters(file, node).items():
        ours = getattr(params, name)
        assert (list(ours) if isinstance(ours, tuple) else ours) == value, name


@pytest.mark.parametrize(
    ("file", "topics"),
    [
        ("intel_manipulator_config_cr3a", ("/joint_states", "", "/gazebo_position_controller/commands")),
        ("orin_manipulator_config_cr3a", ("/joint_states", "/isaacsim/joint_command", "")),
    ],
)
def test_each_computer_mirrors_to_its_own_simulator(file: str, topics: tuple[str, str, str]) -> None:
    """Encoder, Isaac Sim and Gazebo topic; no publisher where the file has no_param."""
    assert loaded(file, "manipulator_state").topics == topics


@pytest.mark.parametrize("file", ARM_FILES)
def test_the_arm_parameter_file_exists_and_has_the_gears_of_the_simulated_arm(file: str) -> None:
    path = loaded(file, "manipulator_state").parameter_file(config_dir())
    axes = ElementTree.parse(path).getroot().findall("AxisParameters")
    engine = validate(EngineConfig, read_yaml(config_dir() / "wmx_engine_manipulator.yaml"), "engine")
    for axis in range(engine.n_axes):
        kind, block = engine.axis_kind(axis), axes[axis].find("AxisParam")
        assert block is not None
        values = {child.tag: child.text for child in block}
        assert float(values["AxisGearRatioNumerator"] or "nan") == kind.gear_numerator
        assert int(values["AxisPolarity"] or "0") == kind.polarity

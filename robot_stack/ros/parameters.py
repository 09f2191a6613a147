"""Parameters: the YAML file of the node, ROS overrides on top, all of it through the node's validated model.

Every field of the model is declared as a read-only ROS parameter (nested fields with dots), so that ``ros2 param``
shows what is in force, ``-p name:=value`` and ``--params-file`` change it at start, and nothing changes it later
unvalidated.
"""

from __future__ import annotations

from typing import Any, TypeVar

from pydantic import BaseModel
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from robot_stack.core.config import ConfigError, config_dir, read_yaml, validate

# Parameters that rclpy itself declares.
_RCLPY_OWN = ("use_sim_time", "start_type_description_service")

ModelT = TypeVar("ModelT", bound=BaseModel)


def load_parameters(node: Node, model: type[ModelT]) -> ModelT:
    """The parameters of ``node``: ``config/<node name>.yaml`` and its ROS overrides. Raises ConfigError."""
    path = config_dir() / f"{node.get_name()}.yaml"
    values = _flatten(read_yaml(path))
    overrides = {name: item.value for name, item in node._parameter_overrides.items() if not _is_rclpy_own(name)}
    merged = _unflatten({**values, **_empty_lists(overrides, values)})
    parameters = validate(model, merged, f"{node.get_name()} ({path} and overrides)")
    _declare(node, _flatten(parameters.model_dump(mode="json")))
    return parameters


def _empty_lists(overrides: dict[str, Any], values: dict[str, Any]) -> dict[str, Any]:
    """ROS knows no type for a list without items and hands it over as no value."""
    return {
        name: [] if value is None and isinstance(values.get(name), list) else value for name, value in overrides.items()
    }


def refuse_overrides(node: Node) -> None:
    """For nodes without parameters: an override is a mistake worth telling. Raises ConfigError."""
    names = sorted(name for name in node._parameter_overrides if not _is_rclpy_own(name))
    if names:
        raise ConfigError(f"{node.get_name()}: {', '.join(names)}: this node has no parameters")


def _is_rclpy_own(name: str) -> bool:
    return name in _RCLPY_OWN or name.startswith("qos_overrides.")


def _declare(node: Node, values: dict[str, Any]) -> None:
    descriptor = ParameterDescriptor(read_only=True, dynamic_typing=True)
    for name, value in values.items():
        node.declare_parameter(name, _ros_value(value), descriptor, ignore_override=True)


def _ros_value(value: Any) -> Any:
    """ROS arrays hold one type: mixed numbers become floats, anything nested its text."""
    if not isinstance(value, list):
        return value
    if value and all(isinstance(item, (int, float)) and not isinstance(item, bool) for item in value):
        return [float(item) for item in value]
    if all(isinstance(item, str) for item in value):
        return value
    return str(value)


def _flatten(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in values.items():
        name = f"{prefix}{key}"
        flat |= _flatten(value, f"{name}.") if isinstance(value, dict) and value else {name: value}
    return flat


def _unflatten(values: dict[str, Any]) -> dict[str, Any]:
    tree: dict[str, Any] = {}
    for name, value in values.items():
        *path, leaf = name.split(".")
        branch = tree
        for part in path:
            branch = branch.setdefault(part, {})
        branch[leaf] = value
    return tree

"""Parameters: the YAML file of the node, ROS overrides on top, all of it through the node's validated model.

Every field of the model is declared as a read-only ROS parameter (nested fields with dots), so that ``ros2 param``
shows the values in force, ``-p name:=value`` and ``--params-file`` change them at start, and nothing changes them
later without validation.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel

from robot_stack.core.config import ConfigError, config_dir, read_yaml, validate
from robot_stack.middleware.port import Port

ModelT = TypeVar("ModelT", bound=BaseModel)


def load_parameters(port: Port, model: type[ModelT]) -> ModelT:
    """The parameters of a node: ``config/<node name>.yaml`` and its overrides. Raises ConfigError."""
    path = config_dir() / f"{port.name}.yaml"
    values = _flatten(read_yaml(path))
    merged = _unflatten({**values, **_empty_lists(port.parameter_overrides(), values)})
    parameters = validate(model, merged, f"{port.name} ({path} and overrides)")
    port.show_parameters(
        {name: _ros_value(value) for name, value in _flatten(parameters.model_dump(mode="json")).items()}
    )
    return parameters


def _empty_lists(overrides: Mapping[str, Any], values: dict[str, Any]) -> dict[str, Any]:
    """ROS has no type for an empty list and passes it as no value."""
    return {
        name: [] if value is None and isinstance(values.get(name), list) else value for name, value in overrides.items()
    }


def refuse_overrides(port: Port) -> None:
    """For nodes without parameters: an override raises ConfigError."""
    names = sorted(port.parameter_overrides())
    if names:
        raise ConfigError(f"{port.name}: {', '.join(names)}: this node has no parameters")


def _ros_value(value: Any) -> Any:
    """ROS arrays hold one type: mixed numbers become floats, nested values become text."""
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

"""The files that the fleet writes for its processes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from rclpy.parameter import parameter_dict_from_yaml_file, parameter_value_to_python

from robot_stack.supervisor.fleet import ros_value


@pytest.mark.parametrize(
    ("value", "written"),
    [
        ([0, 1.5, 0], [0.0, 1.5, 0.0]),
        ([0, 1], [0, 1]),
        (["a", "b"], ["a", "b"]),
        ([True, False], [True, False]),
        (3, 3),
        ("x", "x"),
    ],
)
def test_values_are_written_so_that_ros_reads_them(value: Any, written: Any, tmp_path: Path) -> None:
    assert ros_value(value) == written
    path = tmp_path / "parameters.yaml"
    path.write_text(yaml.safe_dump({"node": {"ros__parameters": {"name": ros_value(value)}}}))
    read = parameter_dict_from_yaml_file(str(path), target_nodes=["node"])
    assert parameter_value_to_python(read["name"].value) == written

"""The parameters: the shipped ones are valid, invalid ones are rejected."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from robot_stack.core.config import load
from robot_stack.system_monitor.params import SystemMonitorParams

PARAMS = load(SystemMonitorParams, "system_monitor")


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"expected_processes": ("nobody",)}, "nobody is not a process"),
        ({"groups": {"A": ("x",), "B": ("x",)}}, "x is in two groups"),
        ({"base_path": "Robot"}, "base_path"),
        ({"cpu_window_s": 0.0}, "cpu_window_s"),
        ({"proc_folder": ""}, "proc_folder"),
    ],
)
def test_wrong_parameters_are_refused(changes: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        SystemMonitorParams(**{**PARAMS.model_dump(), **changes})

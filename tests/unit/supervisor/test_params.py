"""The supervisor's tuning is checked before anything starts."""

from __future__ import annotations

from typing import Any

import pytest

from robot_stack.core.config import ConfigError, load
from robot_stack.supervisor.params import SupervisorParams


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"realtime_priority": {"safty_monitor": 5}}, "safty_monitor is no process of the stack"),
        ({"realtime_priority": {"safety_monitor": 0}}, "realtime_priority.safety_monitor"),
        ({"niceness": {"critical": -10}}, "niceness: limiting, optional missing"),
        ({"own_niceness": -21}, "own_niceness"),
        ({"terminate_s": 1.0}, "terminate_s must be greater than interrupt_s"),
    ],
)
def test_what_makes_no_sense_is_refused(change: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint):
        load(SupervisorParams, "supervisor", change)

"""SIGKILL of a critical process: the robot stands, and the supervisor brings the process back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(900)


def test_the_hardware_interface_is_killed_and_the_robot_stands(stack: StackUnderTest) -> None:
    """The other critical processes: tests/simulated/test_kills.py."""
    name = "swerve_hardware_interface"
    stack.drive_at(0.6)
    pid = stack.kill(name)
    stack.wait_stands(6.0)
    stack.let_go()
    stack.wait_restarted(name, pid)
    if stack.safety.last.safety_state == "EMERGENCY_STOP":
        stack.release()
    stack.wait_safety("NORMAL", deadline_s=60.0)
    stack.drive_at(0.3)

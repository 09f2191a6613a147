"""SIGKILL of any process: the robot ends in a declared state, and the supervisor brings the process back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(900)


# The other critical processes: tests/simulated/test_kills.py.
@pytest.mark.parametrize("name", ["swerve_hardware_interface", "safety_monitor"])
def test_a_critical_process_is_killed_and_the_robot_stands(stack: StackUnderTest, name: str) -> None:
    stack.drive_at(0.6)
    pid = stack.kill(name)
    stack.wait_stands(6.0)
    stack.let_go()
    stack.wait_restarted(name, pid)
    if stack.safety.last.safety_state == "EMERGENCY_STOP":
        stack.release()
    stack.wait_safety("NORMAL", deadline_s=60.0)
    stack.drive_at(0.3)


def test_hanging_button_process_is_an_emergency(stack: StackUnderTest) -> None:
    """A missed press is a hazard, so a comfort stop is not enough."""
    stack.drive_at(0.6)
    stack.inject("process_hang", "emergency_stop_button")
    try:
        stack.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
        stack.wait_stands(6.0)
        stack.let_go()
    finally:
        stack.inject("clear", "process_hang")
    stack.release()

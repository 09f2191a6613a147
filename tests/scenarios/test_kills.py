"""SIGKILL of any process: the robot ends in a declared state, and the supervisor brings the process back."""

from __future__ import annotations

import os
import signal
import time
from typing import TYPE_CHECKING

import pytest

from robot_stack.supervisor.control import ask
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(180)


@pytest.mark.parametrize(
    "name",
    ["swerve_hardware_interface", "swerve_controller", "emergency_stop_button", "safety_monitor", "ndt_localization"],
)
def test_a_critical_process_is_killed_and_the_robot_stands(stack: StackUnderTest, name: str) -> None:
    stack.drive_at(0.6)
    pid = stack.kill(name)
    stack.wait_stands(6.0)
    stack.let_go()
    stack.wait_restarted(name, pid)
    if stack.safety.last.emergency_stop_active:
        stack.release()
    stack.wait_safety("NORMAL", deadline_s=20.0)
    stack.drive_at(0.3)


@pytest.mark.parametrize("name", ["navigation_controller", "mission_manager"])
def test_another_process_hangs_and_the_robot_is_slow(stack: StackUnderTest, name: str) -> None:
    # Stopped and not killed: a killed one is back before its silence lasts the second that NODE_DEAD takes.
    stack.drive_at(1.0)
    pid = stack.kill(name, signal.SIGSTOP)
    try:
        stack.wait_safety("DEGRADED", "NODE_DEAD")
        stack.limit.wait(lambda m: "NODE_DEAD" in m.reason and m.max_linear_velocity <= 0.5, "the limit")
    finally:
        os.kill(pid, signal.SIGCONT)
    stack.wait_safety("NORMAL", deadline_s=20.0)


def test_the_world_and_its_engine_are_killed(stack: StackUnderTest) -> None:
    stack.drive_at(0.6)
    pid = stack.kill("sim_world")
    stack.wait_safety("EMERGENCY_STOP", "DRIVE_FAULT")
    stack.let_go()
    stack.wait_restarted("sim_world", pid)
    stack.truth.wait(lambda _: True, "ground truth")
    stack.release()
    stack.wait_safety("NORMAL", deadline_s=30.0)
    stack.drive_at(0.3)


def test_a_latched_stop_survives_the_monitor(stack: StackUnderTest) -> None:
    stack.drive_at(0.6)
    stack.estop(True)
    stack.wait_safety("EMERGENCY_STOP")
    stack.estop(False)
    pid = stack.kill("safety_monitor")
    stack.wait_restarted("safety_monitor", pid)
    count = len(stack.safety.items)
    wait_for(lambda: len(stack.safety.items) > count + 10, "the new monitor's status")
    assert all(m.safety_state == "EMERGENCY_STOP" for m in stack.safety.messages[count:])
    assert stack.stands


def test_a_mission_survives_its_manager_and_waits_for_a_person(stack: StackUnderTest) -> None:
    stack.command("START_MISSION", "short_hop")
    stack.mission.wait(lambda m: m.state == "RUNNING", "the mission runs")
    wait_for(lambda: stack.speed_mps > 0.2, "the robot drives")
    pid = stack.kill("mission_manager")
    stack.wait_restarted("mission_manager", pid)
    status = stack.mission.wait(lambda m: m.state == "PAUSED", "the mission is paused")
    assert status.mission_id == "short_hop"
    stack.wait_stands()
    stack.wait_safety("NORMAL")
    stack.command_until("RESUME", "RUNNING")
    stack.mission.wait(lambda m: m.state == "COMPLETED", "the mission is completed", 60.0)


def test_a_pause_of_the_whole_machine_is_no_fault(stack: StackUnderTest) -> None:
    stack.drive_at(0.4)
    count = len(stack.safety.items)
    pause(stack, 0.12)
    wait_for(lambda: len(stack.safety.items) > count + 15, "the safety monitor's status after the pause")
    assert not [m.active_faults for m in stack.safety.messages[count:] if m.safety_state == "EMERGENCY_STOP"]
    wait_for(lambda: stack.speed_mps > 0.3, "the robot goes on")


def test_a_longer_pause_ends_in_a_stop_that_an_operator_can_release(stack: StackUnderTest) -> None:
    stack.drive_at(0.4)
    pause(stack, 0.8)
    stack.wait_safety("EMERGENCY_STOP")
    stack.wait_stands(5.0)
    stack.let_go()
    stack.release()
    stack.wait_safety("NORMAL")


def pause(stack: StackUnderTest, seconds: float) -> None:
    """All processes of the stack stand still for so long, as on a virtual machine that is held."""
    pids = [int(item["pid"]) for item in ask("status")["processes"]]
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    time.sleep(seconds)
    for pid in pids:
        os.kill(pid, signal.SIGCONT)

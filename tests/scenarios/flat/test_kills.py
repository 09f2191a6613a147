"""SIGKILL of any process: the robot ends in a declared state, and the supervisor brings the process back."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
from std_msgs.msg import Bool

from robot_stack.contract import topics
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(900)


# The controller's death is in test_real_time: this world waits for its odometry until it is nearly back.
@pytest.mark.parametrize("name", ["swerve_hardware_interface", "safety_monitor", "ndt_localization"])
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


def test_a_killed_button_comes_back_and_stops_the_robot(stack: StackUnderTest) -> None:
    """It may be back before its silence has lasted the second that NODE_DEAD takes; a press must not be missed."""
    stack.drive_at(0.6)
    pid = stack.kill("emergency_stop_button")
    stack.inject("estop_button", value=1.0)
    stack.wait_restarted("emergency_stop_button", pid)
    stack.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
    stack.wait_stands(6.0)
    stack.let_go()
    stack.inject("estop_button", value=0.0)
    stack.release()


@pytest.mark.parametrize("fault", ["process_killed", "process_hang"])
def test_without_its_safety_monitor_the_robot_brakes_hard(stack: StackUnderTest, fault: str) -> None:
    """With a passenger at 1.0 m/s: 0.25 m of silence, 0.25 m of braking, and a tick. Gently it would be 1.7 m."""
    stack.peer.publish(topics.PASSENGER_ATTACHED, Bool(data=True))
    stack.limit.wait(lambda message: "PASSENGER_ONBOARD" in message.reason, "the passenger's limit")
    stack.drive_at(1.0)
    begun = stack.truth.last.pose.pose.position
    stack.inject(fault, "safety_monitor")
    try:
        stack.wait_stands(20.0)
        ended = stack.truth.last.pose.pose.position
    finally:
        stack.let_go()
        stack.inject("clear", "process_hang")
        stack.peer.publish(topics.PASSENGER_ATTACHED, Bool(data=False))
    distance_m = math.dist((begun.x, begun.y), (ended.x, ended.y))
    print(f"safety monitor, {fault}: {distance_m:.2f} m")
    assert distance_m < 0.75
    wait_for(lambda: stack.process("safety_monitor")["state"] == "ready", "the monitor", 60.0, poll_s=0.1)


def test_a_button_whose_process_hangs_is_an_emergency(stack: StackUnderTest) -> None:
    """A press of it would be missed: that is no case for a comfort stop."""
    stack.drive_at(0.6)
    stack.inject("process_hang", "emergency_stop_button")
    try:
        stack.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
        stack.wait_stands(6.0)
        stack.let_go()
    finally:
        stack.inject("clear", "process_hang")
    stack.release()


@pytest.mark.parametrize("name", ["navigation_controller", "mission_manager"])
def test_another_process_hangs_and_the_robot_is_slow(stack: StackUnderTest, name: str) -> None:
    # Stopped and not killed: a killed one is back before its silence lasts the second that NODE_DEAD takes.
    stack.drive_at(1.0)
    stack.inject("process_hang", name)
    try:
        stack.wait_safety("DEGRADED", "NODE_DEAD")
        stack.limit.wait(lambda m: "NODE_DEAD" in m.reason and m.max_linear_velocity <= 0.5, "the limit")
    finally:
        stack.inject("clear", "process_hang")
    stack.wait_safety("NORMAL", deadline_s=60.0)


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
    stack.mission.wait(lambda m: m.state == "COMPLETED", "the mission is completed", 150.0)

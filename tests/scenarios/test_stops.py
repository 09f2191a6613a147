"""Every way to an emergency stop, and the only way back, on the whole stack in physics."""

from __future__ import annotations

import os
import signal
import time
from typing import TYPE_CHECKING

import pytest

from robot_stack.contract import topics
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(300)


def test_the_chain_that_stops_the_wheels_goes_before_everybody(stack: StackUnderTest) -> None:
    def priority(name: str) -> int:
        return os.sched_getparam(stack.process(name)["pid"]).sched_priority

    assert [priority(name) for name in ("safety_monitor", "swerve_hardware_interface")] == [5, 5]
    assert [priority(name) for name in ("perception_pipeline", "mission_manager")] == [0, 0]


def test_a_message_stops_the_robot_and_false_alone_does_not_let_it_go_on(stack: StackUnderTest) -> None:
    stack.drive_at(0.8)
    stack.estop(True)
    stack.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
    stack.wait_stands(5.0)
    stack.estop(False)
    count = len(stack.commands.items)
    wait_for(lambda: len(stack.commands.items) > count + 20, "one second of wheel commands")
    assert all(m.drive_velocity == 0.0 for c in stack.commands.messages[count:] for m in c.modules)
    assert stack.stands
    assert stack.reset().success
    wait_for(lambda: stack.speed_mps > 0.7, "driving again, because the operator still asks for it")


def test_the_button_stops_the_robot_and_holds_it_whatever_others_publish(stack: StackUnderTest) -> None:
    stack.drive_at(0.8)
    stack.inject("estop_button", value=1.0)
    stack.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
    stack.wait_stands(5.0)
    stack.estop(False)
    answer = stack.reset()
    assert not answer.success
    assert "/emergency_stop" in answer.message or "ESTOP_PRESSED" in answer.message
    stack.inject("estop_button", value=0.0)
    stack.release()
    wait_for(lambda: stack.speed_mps > 0.7, "driving again")


def test_a_reset_is_refused_while_the_robot_moves(stack: StackUnderTest) -> None:
    stack.drive_at(1.0)
    stack.estop(True)
    stack.estop(False)
    answer = stack.reset()  # 0.5 s of braking lie ahead
    assert not answer.success
    stack.wait_stands(5.0)


@pytest.mark.parametrize(
    ("kind", "target", "fault"),
    [
        ("drive_alarm", "fl_drive", "DRIVE_FAULT"),
        ("drive_alarm", "rr_steer", "DRIVE_FAULT"),
        ("bus_loss", "", "DRIVE_FAULT"),
        ("engine_stall", "", "DRIVE_FAULT"),
        ("encoder_freeze", "fr_drive", "DRIVE_FAULT"),
        ("encoder_freeze", "rl_steer", ""),
    ],
)
def test_a_drive_that_fails_ends_in_an_emergency_stop(
    stack: StackUnderTest, kind: str, target: str, fault: str
) -> None:
    stack.drive(0.4, 0.0, 0.3)
    wait_for(lambda: stack.speed_mps > 0.35, "the robot drives a curve")
    if kind == "encoder_freeze" and target.endswith("steer"):
        stack.drive(0.3, 0.3)  # the heading must change, or a frozen encoder shows nothing
    stack.inject(kind, target)
    if fault:
        stack.wait_safety("EMERGENCY_STOP", fault)
    else:
        stack.wait_safety("EMERGENCY_STOP")
    stack.wait_stands(6.0)
    stack.let_go()
    answer = stack.reset()
    assert not answer.success, "an emergency stop was released while its cause is there"
    stack.inject("clear")
    stack.release()
    stack.wait_safety("NORMAL", deadline_s=60.0)
    stack.drive_at(0.3)


def test_silence_of_the_operator_stops_the_robot(stack: StackUnderTest) -> None:
    stack.drive_at(0.8)
    stack.let_go()
    stack.wait_stands(6.0)
    assert stack.safety.last.safety_state == "NORMAL"


@pytest.mark.parametrize("kind", ["imu_silent", "imu_frozen"])
def test_without_an_imu_the_robot_is_slow(stack: StackUnderTest, kind: str) -> None:
    stack.drive_at(1.0)
    stack.inject(kind)
    stack.wait_safety("DEGRADED", "IMU_TIMEOUT")
    wait_for(lambda: stack.speed_mps < 0.52, "0.5 m/s at most")
    assert stack.speed_mps > 0.3
    assert "IMU_TIMEOUT" in stack.limit.last.reason
    stack.inject("clear")
    stack.wait_safety("NORMAL")
    wait_for(lambda: stack.speed_mps > 0.9, "full speed again")


def test_a_noisy_imu_stops_nobody(stack: StackUnderTest) -> None:
    stack.drive_at(0.6)
    stack.inject("imu_noise", value=10.0)
    start = len(stack.safety.items)
    wait_for(lambda: len(stack.safety.items) > start + 30, "three seconds of safety status")
    assert {m.safety_state for m in stack.safety.messages[start:]} == {"NORMAL"}
    assert stack.speed_mps > 0.5


@pytest.mark.parametrize("name", ["swerve_hardware_interface", "perception_pipeline"])
def test_the_simulated_world_waits_for_a_process_that_is_held_up(stack: StackUnderTest, name: str) -> None:
    """What every story of simulated time relies on."""
    stack.drive_at(0.4)
    start = len(stack.safety.items)
    stack.kill(name, signal.SIGSTOP)
    time.sleep(0.6)  # of the machine's time: what is to be survived
    stack.kill(name, signal.SIGCONT)
    wait_for(lambda: len(stack.safety.items) > start + 20, "two seconds of safety status")
    assert {m.safety_state for m in stack.safety.messages[start:]} == {"NORMAL"}


def test_slippery_ground_shows_in_the_odometrys_covariance_and_ends_no_ride(stack: StackUnderTest) -> None:
    stack.drive_at(0.5)
    stack.inject("slip", "", 0.02, duration_s=2.0)
    stack.drive(1.0, 0.0, 0.8)
    start = len(stack.safety.items)
    wait_for(lambda: len(stack.safety.items) > start + 40, "four seconds of safety status")
    assert all(not m.emergency_stop_active for m in stack.safety.messages[start:])
    odom = stack.odom.last
    assert odom.pose.covariance[0] > 0.0
    stack.let_go()
    stack.wait_stands()


def test_commands_that_are_no_commands_move_nothing(stack: StackUnderTest) -> None:
    for bad in (float("nan"), float("inf"), -float("inf")):
        stack.drive(bad)
        count = len(stack.commands.items)
        wait_for(lambda count=count: len(stack.commands.items) > count + 10, "half a second of wheel commands")
        assert all(m.drive_velocity == 0.0 for c in stack.commands.messages[count:] for m in c.modules)
    assert "linear.x" in stack.log("swerve_controller")
    stack.drive(1e12)
    wait_for(lambda: stack.speed_mps > 0.5, "a huge wish is cut to the limits")
    wait_for(lambda: stack.speed_mps > 0.9, "top speed")
    assert stack.speed_mps < 1.55
    limit = max(abs(m.drive_velocity) for m in stack.commands.last.modules)
    assert limit <= 1.55, topics.WHEEL_COMMANDS.name

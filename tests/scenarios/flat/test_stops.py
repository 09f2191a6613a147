"""Every way to an emergency stop, and the only way back, on the whole stack in physics."""

from __future__ import annotations

import os
import signal
import time
from typing import TYPE_CHECKING

import pytest
from std_msgs.msg import Bool

from custom_msgs.srv import ClearEmergencyStop
from robot_stack.contract import services, topics
from tests.support.rights import needs_rights
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(900)


@needs_rights
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
    stack.wait_safety("NORMAL")
    count = len(stack.commands.items)
    wait_for(lambda: len(stack.commands.items) > count + 40, "two seconds of wheel commands")
    # The stick is still held: the end of a stop starts no motion.
    assert all(m.drive_velocity == 0.0 for c in stack.commands.messages[count:] for m in c.modules)
    assert stack.stands
    stack.drive(0.0)
    count = len(stack.commands.items)
    wait_for(lambda: len(stack.commands.items) > count + 10, "half a second of a stick that is let go")
    stack.drive_at(0.8)


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
    stack.wait_safety("NORMAL")
    count = len(stack.commands.items)
    wait_for(lambda: len(stack.commands.items) > count + 20, "a second of wheel commands")
    assert stack.stands
    stack.let_go()
    count = len(stack.commands.items)
    wait_for(lambda: len(stack.commands.items) > count + 10, "half a second of silence")
    stack.drive_at(0.8)


def test_a_goal_and_a_mission_need_to_be_asked_for_again_after_a_stop(stack: StackUnderTest) -> None:
    stack.command("START_MISSION", "short_hop")
    stack.mission.wait(lambda m: m.state == "RUNNING", "the mission runs")
    wait_for(lambda: stack.speed_mps > 0.2, "the robot drives")
    stack.estop(True)
    stack.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
    stack.mission.wait(lambda m: m.state == "PAUSED" and "emergency stop" in m.reason, "the mission is stopped")
    stack.wait_stands(6.0)
    stack.release()
    stack.wait_safety("NORMAL")
    count = len(stack.commands.items)
    wait_for(lambda: len(stack.commands.items) > count + 60, "three seconds of wheel commands")
    assert all(m.drive_velocity == 0.0 for c in stack.commands.messages[count:] for m in c.modules)
    assert stack.mission.last.state == "PAUSED"
    stack.command_until("RESUME", "RUNNING")
    wait_for(lambda: stack.speed_mps > 0.2, "the robot drives, because it was asked to")


def test_a_true_of_nobody_known_is_released_by_name_only(stack: StackUnderTest) -> None:
    stack.drive_at(0.4)
    stack.peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
    stack.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
    stack.wait_stands(5.0)
    stack.let_go()
    stack.estop(False)
    wait_for(lambda: "pressed by unknown" in stack.reset().message, "a refusal that names it")
    cleared = stack.peer.call(services.CLEAR_EMERGENCY_STOP, ClearEmergencyStop.Request(source="unknown"))
    assert cleared.success, cleared.message
    stack.release()


def test_a_reset_is_refused_while_the_robot_moves(stack: StackUnderTest) -> None:
    stack.drive_at(1.0)
    stack.estop(True)
    stack.estop(False)
    answer = stack.reset()  # 0.5 s of braking lie ahead
    assert not answer.success
    stack.wait_stands(5.0)


@pytest.mark.parametrize(
    ("kind", "target"),
    [("drive_alarm", "fl_drive"), ("drive_alarm", "rr_steer"), ("bus_loss", ""), ("engine_stall", "")],
)
def test_a_drive_that_fails_ends_in_an_emergency_stop(stack: StackUnderTest, kind: str, target: str) -> None:
    stack.drive(0.4, 0.0, 0.3)
    wait_for(lambda: stack.speed_mps > 0.35, "the robot drives a curve")
    stack.inject(kind, target)
    stack.wait_safety("EMERGENCY_STOP", "DRIVE_FAULT")
    stack.wait_stands(6.0)
    stack.let_go()
    answer = stack.reset()
    assert not answer.success, "an emergency stop was released while its cause is there"
    stack.inject("clear")
    stack.release()
    stack.wait_safety("NORMAL", deadline_s=60.0)
    stack.drive_at(0.3)


@pytest.mark.parametrize("target", ["fr_drive", "rl_steer"])
def test_a_frozen_encoder_stops_the_robot_whenever_its_axis_is_to_turn(stack: StackUnderTest, target: str) -> None:
    """At rest it cannot be told from one that works: the stop can be released, and the next motion ends in another."""

    def ends_in_a_stop() -> None:
        stack.drive(0.3, 0.3)  # another heading: a steering axis that stays where it is shows nothing
        stack.wait_safety("EMERGENCY_STOP")
        stack.wait_stands(6.0)
        stack.let_go()

    stack.drive(0.4, 0.0, 0.3)
    wait_for(lambda: stack.speed_mps > 0.35, "the robot drives a curve")
    stack.inject("encoder_freeze", target)
    ends_in_a_stop()
    stack.release()
    stack.wait_safety("NORMAL")
    ends_in_a_stop()
    stack.inject("clear")
    # An encoder that is back has leapt; if it leapt far, its amplifier takes that for an overspeed once more.
    stack.drive_at(0.3, releasing=True)


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


def test_the_simulated_world_waits_for_a_stick_that_is_held_up(stack: StackUnderTest) -> None:
    """A test that has no time for its stick for a moment has not let go of it."""
    stack.drive_at(0.4)
    start = len(stack.truth.items)
    with stack.stick.held_up():
        time.sleep(0.6)  # of the machine's time: what is to be survived
    wait_for(lambda: len(stack.truth.items) > start + 50, "another second of the ride")
    assert min(m.twist.twist.linear.x for m in stack.truth.messages[start:]) > 0.3


def test_slippery_ground_shows_in_the_odometrys_covariance_and_ends_no_ride(stack: StackUnderTest) -> None:
    stack.drive_at(0.5)
    stack.inject("slip", "", 0.02, duration_s=2.0)
    stack.drive(1.0, 0.0, 0.8)
    start = len(stack.safety.items)
    wait_for(lambda: len(stack.safety.items) > start + 40, "four seconds of safety status")
    assert all(m.safety_state != "EMERGENCY_STOP" for m in stack.safety.messages[start:])
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
    wait_for(lambda: stack.speed_mps > 0.5, "a huge command is cut to the limits")
    wait_for(lambda: stack.speed_mps > 0.9, "top speed")
    assert stack.speed_mps < 1.55
    limit = max(abs(m.drive_velocity) for m in stack.commands.last.modules)
    assert limit <= 1.55, topics.WHEEL_COMMANDS.name

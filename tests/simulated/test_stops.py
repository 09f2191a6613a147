"""Emergency stops, their release, and faults of drives and inertial unit, on the whole robot in physics.

Each source, reset and restart alone: tests/unit/safety, tests/simulated/nodes/test_safety_monitor.py.
"""

from __future__ import annotations

import pytest

from custom_msgs.srv import ClearEmergencyStop
from robot_stack.contract import services
from tests.simulated.shared import shared
from tests.simulated.stage import Stage, staged

pytestmark = shared(staged)


def test_a_false_alone_ends_no_stop_and_the_end_of_a_stop_starts_no_motion() -> None:
    with staged() as stage:
        stage.drive_at(0.8)
        stage.estop(True)
        stage.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
        stage.wait_stands(5.0)
        stage.estop(False)
        stage.assert_wheels_rest(1.0)
        answer = stage.reset()
        assert answer.success, answer.message
        stage.wait_safety("NORMAL")
        stage.assert_wheels_rest(2.0)  # the stick is still held
        stage.drive(0.0)
        stage.run(0.5)
        stage.drive_at(0.8)
        # Without the operator's commands the robot ends in a comfort stop, without a fault.
        stage.let_go()
        stage.wait_stands(6.0)
        assert stage.safety.last.safety_state == "NORMAL"


@pytest.mark.parametrize(("kind", "target"), [("drive_alarm", "rr_steer"), ("bus_loss", ""), ("engine_stall", "")])
def test_a_drive_that_fails_ends_in_an_emergency_stop(kind: str, target: str) -> None:
    with staged() as stage:
        stage.drive(0.4, 0.0, 0.3)
        stage.wait_faster(0.35)
        stage.inject(kind, target)
        stage.wait_safety("EMERGENCY_STOP", "DRIVE_FAULT")
        stage.wait_stands(6.0)
        stage.let_go()
        assert not stage.reset().success, "an emergency stop was released while its cause is there"
        stage.inject("clear")
        stage.run(3.0)  # the drive reconnects and switches its servos on
        stage.release()
        stage.wait_safety("NORMAL")
        stage.drive_at(0.3)


@pytest.mark.parametrize("target", ["fr_drive", "rl_steer"])
def test_a_frozen_encoder_stops_the_robot_whenever_its_axis_is_to_turn(target: str) -> None:
    """At rest it looks like a working one: the stop can be released, and the next motion causes another."""
    with staged() as stage:
        stage.drive(0.4, 0.0, 0.3)
        stage.wait_faster(0.35)
        stage.inject("encoder_freeze", target)
        _ends_in_a_stop(stage)
        stage.release()
        stage.wait_safety("NORMAL")
        _ends_in_a_stop(stage)
        stage.inject("clear")


def test_a_module_that_does_not_turn_is_a_fault_of_the_steering() -> None:
    """Its command is lost on the way to the engine, so no axis raises an alarm."""
    with staged() as stage:
        stage.drive(0.5)
        stage.wait_faster(0.3)
        stage.stack.faults.inject(
            "messages_corrupted", "/swerve/wheel_commands>swerve_hardware_interface:modules.0.steering_angle=0.0"
        )
        stage.drive(0.4, 0.5)
        stage.wait_safety("EMERGENCY_STOP", "STEERING_FAULT", 5.0)
        stage.wait_stands(5.0)
        stage.let_go()


def _ends_in_a_stop(stage: Stage) -> None:
    stage.drive(0.3, 0.3)  # another heading: a steering axis without motion reveals no fault
    stage.wait_safety("EMERGENCY_STOP")
    stage.wait_stands(6.0)
    stage.let_go()


@pytest.mark.parametrize("kind", ["imu_silent", "imu_frozen"])
def test_without_an_imu_the_robot_is_slow(kind: str) -> None:
    with staged() as stage:
        stage.drive_at(1.0)
        stage.inject(kind)
        stage.wait_safety("DEGRADED", "IMU_TIMEOUT")
        stage.wait(lambda: stage.speed_mps < 0.52, "0.5 m/s at most")
        assert stage.speed_mps > 0.3
        assert "IMU_TIMEOUT" in stage.limit.last.reason
        stage.inject("clear")
        stage.wait_safety("NORMAL")
        stage.wait_faster(0.9)


def test_noise_of_the_imu_and_slippery_ground_end_no_ride() -> None:
    with staged() as stage:
        stage.drive_at(0.6)
        begun_s = stage.now_s
        stage.inject("imu_noise", value=10.0)
        stage.run(2.0)
        assert stage.safety_states(begun_s) == {"NORMAL"}
        assert stage.speed_mps > 0.5
        stage.inject("clear")
        stage.inject("slip", "", 0.02, duration_s=2.0)
        stage.drive(1.0, 0.0, 0.8)
        begun_s = stage.now_s
        stage.run(3.0)
        assert "EMERGENCY_STOP" not in stage.safety_states(begun_s)
        assert stage.odom.last.pose.covariance[0] > 0.0
        stage.let_go()
        stage.wait_stands()


def test_a_mission_needs_to_be_resumed_after_a_stop() -> None:
    with staged() as stage:
        stage.command("START_MISSION", "short_hop")
        stage.wait_mission("RUNNING")
        stage.wait_faster(0.2)
        stage.estop(True)
        stage.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
        assert "emergency stop" in stage.wait_mission("PAUSED").reason
        stage.wait_stands(6.0)
        stage.release()
        stage.wait_safety("NORMAL")
        stage.assert_wheels_rest(3.0)
        assert stage.mission.last.state == "PAUSED"
        stage.command("RESUME")
        stage.wait_mission("RUNNING")
        stage.wait_faster(0.2)


def test_the_press_of_a_process_that_died_is_not_released_by_its_successor() -> None:
    """Both have the same name: the second one presses and releases, but the first one's press stays active."""
    with staged() as stage:
        stage.expected_failures.add("emergency_stop_button")
        stage.inject("estop_button", value=1.0)
        stage.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
        stage.kill("emergency_stop_button")
        stage.inject("estop_button", value=0.0)
        stage.wait_restarted("emergency_stop_button")
        for pressed in (1.0, 0.0):
            stage.inject("estop_button", value=pressed)
            stage.run(1.0)
        stage.estop(False)
        stage.run(0.5)
        answer = stage.reset()
        assert not answer.success
        assert "pressed by emergency_stop_button" in answer.message
        cleared = stage.call(services.CLEAR_EMERGENCY_STOP, ClearEmergencyStop.Request(source="emergency_stop_button"))
        assert cleared.success, cleared.message
        stage.release()

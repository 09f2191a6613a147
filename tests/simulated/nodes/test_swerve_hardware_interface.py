"""The hardware interface on a motion engine with virtual drives: from topics to the engine, and back."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus, SwerveModuleCommand, SwerveModuleCommandArray
from robot_stack.contract import topics
from robot_stack.contract.frames import DRIVE_AXES, JOINTS, STEER_AXES
from robot_stack.core.robot import load_robot
from robot_stack.core.runtime import runtime_dir
from robot_stack.middleware.conversions import time_from_s, time_to_s
from robot_stack.wmx.axes import StatusSnapshot
from tests.simulated.bench import COMPUTE_S, LATENCY_S, Bench

RADIUS_M = load_robot().wheel_radius_m
WELL, EMERGENCY = SafetyStatus.NORMAL, SafetyStatus.EMERGENCY_STOP
BLOCK_S = 0.005  # of the engine
TICK_S = 0.02


def wheel_commands(speed_mps: float, angle_rad: float = 0.0, stamp_s: float = 0.0) -> SwerveModuleCommandArray:
    message = SwerveModuleCommandArray(
        modules=[SwerveModuleCommand(module_id=i, drive_velocity=speed_mps, steering_angle=angle_rad) for i in range(4)]
    )
    message.header.stamp = time_from_s(stamp_s)
    return message


class Rig:
    """Engine, node, and the node's inputs."""

    def __init__(self, bench: Bench) -> None:
        self.bench, self.engine = bench, bench.engine
        self.joints = bench.listen(topics.JOINT_STATES)
        for row in (topics.WHEEL_COMMANDS, topics.EMERGENCY_STOP):
            bench.publisher(row)

    def start_node(self) -> None:
        self.node = self.bench.start("swerve_hardware_interface")

    def safety(self, state: str) -> None:
        self.bench.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state=state), 10.0)

    def command(self, speed_mps: float, angle_rad: float = 0.0) -> None:
        self.bench.repeat(topics.WHEEL_COMMANDS, lambda: wheel_commands(speed_mps, angle_rad), 20.0)

    def press(self, pressed: bool = True) -> None:
        self.bench.publish(topics.EMERGENCY_STOP, Bool(data=pressed))

    def log(self) -> str:
        return self.bench.log("swerve_hardware_interface")

    def says(self, text: str) -> None:
        self.bench.wait(lambda: text in self.log(), f"{text!r} in the log")

    def status(self) -> StatusSnapshot:
        """The engine's status, read without the node."""
        return self.engine.device.read_status()[1]

    def wait_status(self, holds: Callable[[StatusSnapshot], Any], what: str) -> StatusSnapshot:
        self.bench.wait(lambda: holds(self.status()), what)
        return self.status()

    def wait_servos(self, on: bool = True) -> None:
        self.wait_status(lambda s: (s.servo_on == on).all(), f"all servos {'on' if on else 'off'}")

    def wait_speed(self, speed_mps: float) -> None:
        """Waits until all four wheels turn at this speed."""
        self.wait_status(lambda s: (abs(wheels_mps(s) - speed_mps) < 0.01).all(), f"wheels at {speed_mps} m/s")

    def drive(self, speed_mps: float) -> None:
        self.command(speed_mps)
        self.wait_speed(speed_mps)

    def ready(self) -> Rig:
        self.engine.run()
        self.safety(WELL)
        self.start_node()
        self.command(0.0)
        self.wait_servos()
        return self

    def joint_states(self, duration_s: float) -> list[Any]:
        begun_s = self.bench.now_s
        self.bench.run(duration_s)
        return self.joints.since(begun_s)

    def stays_stopped(self) -> None:
        self.bench.run(1.0)
        snapshot = self.status()
        assert snapshot.emergency_stop
        assert not snapshot.velocity_cmd.any()

    def release(self) -> None:
        """Ends the emergency after the node has received its status."""
        self.bench.run(0.3)
        self.safety(WELL)
        self.wait_status(lambda s: not s.emergency_stop and s.servo_on.all(), "the release in the engine")


def wheels_mps(snapshot: StatusSnapshot) -> Any:
    return snapshot.actual_velocity[list(DRIVE_AXES)] * RADIUS_M


def headings_rad(snapshot: StatusSnapshot) -> Any:
    return snapshot.actual_pos[list(STEER_AXES)]


@pytest.fixture
def rig(bench: Bench) -> Rig:
    return Rig(bench)


def test_joint_states_of_all_axes_at_their_rate(rig: Rig) -> None:
    messages = rig.ready().joint_states(2.0)
    assert messages[-1].name == list(JOINTS)
    assert [len(field) for field in (messages[-1].position, messages[-1].velocity, messages[-1].effort)] == [8, 8, 8]
    stamps = [time_to_s(message.header.stamp) for message in messages]
    # Stamps are engine time, from its newest block.
    assert [later - earlier for earlier, later in pairwise(stamps)] == pytest.approx(
        [TICK_S] * (len(stamps) - 1), abs=BLOCK_S + 1e-6
    )
    assert 0.0 <= rig.bench.stamp_s() - stamps[-1] <= TICK_S + BLOCK_S + COMPUTE_S + LATENCY_S + 1e-6


def test_engine_is_configured_before_the_servos_come_on(rig: Rig) -> None:
    """Without the drive the engine has the vendor's parameters; with it those of config/robot.yaml."""
    rig.engine.run()
    config = rig.engine.device.core_motion.config
    assert config.GetGearRatio(0) == (0, 1.0, 1.0)
    assert config.GetEmergencyStopParam()[1].eStopDec[0] == 100000.0
    rig.start_node()  # without the safety monitor no servo may come on
    rig.says("waiting for the safety monitor")
    robot = load_robot()
    assert config.GetGearRatio(0) == (0, 16384.0, pytest.approx(math.tau))
    stop = config.GetEmergencyStopParam()[1]
    assert stop.eStopDec[0] == pytest.approx(robot.emergency_deceleration_mps2 / RADIUS_M)
    assert stop.enableEStopSignal
    assert not rig.status().servo_on.any()
    rig.joints.wait()


def test_parameters_that_are_not_the_robots_are_a_start_error(rig: Rig) -> None:
    """The file was changed between its export and the start of the engine."""
    rig.safety(WELL)
    rig.start_node()
    file = runtime_dir() / "robot_wmx_parameters.xml"
    text = file.read_text(encoding="utf-8")
    changed = text.replace("<EStopDec>60.000000</EStopDec>", "<EStopDec>100000.000000</EStopDec>", 1)
    assert changed != text
    file.write_text(changed, encoding="utf-8")
    rig.engine.run()
    rig.says("axis 1 (fl_steer): eStopDec is 100000, expected 60")
    rig.bench.run(3.0)
    assert not rig.status().servo_on.any()
    assert rig.joints.items == []
    file.write_text(text, encoding="utf-8")
    rig.wait_servos()


def test_servos_wait_for_the_safety_monitor(rig: Rig) -> None:
    rig.engine.run()
    rig.start_node()
    rig.joints.wait()  # from standing wheels with servos off
    rig.says("waiting for the safety monitor")
    rig.safety(EMERGENCY)
    rig.bench.run(2.0)
    rig.says("emergency stop")
    assert not rig.status().servo_on.any()
    rig.safety(WELL)
    rig.wait_servos()


# --- motion ----------------------------------------------------------------------------------------------------------


def test_wheels_turn_as_commanded(rig: Rig) -> None:
    rig.ready().command(0.4, 0.5)
    rig.wait_speed(0.4)
    rig.wait_status(lambda s: (abs(headings_rad(s) - 0.5) < 1e-3).all(), "headings at 0.5 rad")
    message = rig.joint_states(0.1)[-1]
    assert message.velocity[0::2] == pytest.approx([0.4 / RADIUS_M] * 4, rel=0.01)
    assert message.position[1::2] == pytest.approx([0.5] * 4, abs=1e-3)


def test_silence_of_the_controller_stops_the_wheels(rig: Rig) -> None:
    rig.ready().drive(0.6)
    silent_s = rig.bench.now_s
    rig.bench.silence(topics.WHEEL_COMMANDS)
    rig.wait_status(lambda s: (s.velocity_cmd[list(DRIVE_AXES)] < 0.59 / RADIUS_M).all(), "wheels slowing down")
    began_s = rig.bench.now_s - silent_s
    rig.wait_speed(0.0)
    took_s = rig.bench.now_s - silent_s
    assert 0.1 <= began_s <= 0.15 + TICK_S + 4.0 * BLOCK_S  # the last command is up to 0.05 s old
    assert 0.25 < took_s - began_s < 0.35  # 0.6 m/s at 2.0 m/s2: no step
    rig.says("no usable /swerve/wheel_commands for 0.15 s")
    rig.drive(0.3)


def test_a_bad_command_is_refused_and_the_wheels_stop(rig: Rig) -> None:
    rig.ready().drive(0.4)
    rig.bench.repeat(topics.WHEEL_COMMANDS, lambda: wheel_commands(math.nan), 20.0)
    rig.wait_speed(0.0)
    rig.says("/swerve/wheel_commands refused: drive_velocity of fl must be within +-2.475 m/s, is nan")
    rig.drive(0.4)
    rig.bench.repeat(topics.WHEEL_COMMANDS, lambda: wheel_commands(0.4, stamp_s=rig.bench.stamp_s() - 5.0), 20.0)
    rig.wait_speed(0.0)
    rig.says("/swerve/wheel_commands refused: header.stamp is 5.0")


# --- emergency stop --------------------------------------------------------------------------------------------------


def test_emergency_stop_reaches_the_engine_at_once_and_decelerates_as_configured(rig: Rig) -> None:
    """At every phase of the tick."""
    rig.ready()
    for phase in range(5):
        rig.drive(1.0)
        rig.bench.run(0.1 + 0.004 * phase)
        pressed_s = rig.bench.now_s
        rig.press()
        stopped = rig.wait_status(lambda s: s.emergency_stop, "the engine's emergency stop")
        assert rig.bench.now_s - pressed_s <= LATENCY_S + COMPUTE_S + BLOCK_S + 1e-6
        assert stopped.servo_on.all()
        rig.wait_status(lambda s: not s.velocity_cmd[list(DRIVE_AXES)].any(), "the end of braking")
        assert rig.bench.now_s - pressed_s == pytest.approx(0.5, abs=3.0 * BLOCK_S)  # 1.0 m/s at 2.0 m/s2
        rig.safety(EMERGENCY)
        rig.press(False)
        rig.release()


def test_wheels_stand_until_both_keys_and_a_fresh_command(rig: Rig) -> None:
    rig.ready().drive(0.3)
    rig.press()
    rig.wait_speed(0.0)
    rig.press(False)
    rig.stays_stopped()  # the monitor has not reported anything yet
    rig.safety(EMERGENCY)
    rig.stays_stopped()
    rig.bench.silence(topics.WHEEL_COMMANDS)
    rig.release()
    rig.bench.run(1.0)
    assert not rig.status().velocity_cmd.any()
    rig.drive(0.3)


def test_emergency_stop_before_the_engine_holds_after_its_start(rig: Rig) -> None:
    rig.safety(WELL)
    rig.start_node()
    rig.press()
    rig.says("no engine to stop")
    rig.engine.run()
    rig.wait_status(lambda s: s.emergency_stop, "the engine's emergency stop")
    assert not rig.status().servo_on.any()


# --- faults ----------------------------------------------------------------------------------------------------------


def test_alarm_of_one_drive_stops_all_until_an_emergency_stop_is_released(rig: Rig) -> None:
    rig.ready().drive(0.5)
    rig.engine.alarm(3, 33)
    rig.wait_status(lambda s: s.emergency_stop, "the engine's emergency stop")
    rig.wait_speed(0.0)
    rig.says("fr_steer alarm 33")
    rig.engine.drives.stubborn = False
    rig.bench.run(2.0)
    assert rig.status().amp_alarm[3]  # only an emergency stop permits clearing it
    rig.safety(EMERGENCY)
    rig.wait_status(lambda s: not s.amp_alarm.any(), "the alarm to be cleared")
    assert not rig.status().servo_on[3]
    rig.release()
    rig.wait_speed(0.5)


def test_lost_bus_stops_joint_states_until_a_release(rig: Rig) -> None:
    rig.ready().drive(0.4)
    rig.engine.drives.connected = False
    rig.wait_status(lambda s: not s.communicating, "the loss of the bus")
    rig.says("communication with the drives is lost")
    rig.bench.run(0.1)
    assert rig.joint_states(1.0) == []
    rig.safety(EMERGENCY)
    rig.engine.drives.connected = True
    rig.wait_status(lambda s: s.communicating and s.emergency_stop, "communication and the engine's emergency stop")
    assert not rig.status().servo_on.any()
    rig.joints.wait_next()
    rig.release()
    rig.wait_speed(0.4)


def test_killed_engine_is_found_again(rig: Rig) -> None:
    rig.ready().drive(0.4)
    rig.engine.kill()
    rig.says("waiting for the motion engine")
    rig.bench.run(1.0)
    rig.engine.run()
    rig.wait_servos()
    assert rig.joint_states(0.1)
    rig.wait_speed(0.4)


def test_end_stops_the_wheels_and_closes_the_brakes(rig: Rig) -> None:
    rig.ready().drive(0.5)
    assert rig.bench.stop(rig.node) == 0
    assert not rig.status().velocity_cmd.any()
    rig.wait_servos(on=False)

"""The hardware interface between a real engine process on virtual drives and fakes of controller and safety monitor."""

from __future__ import annotations

import json
import math
import os
import signal
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus, SwerveModuleCommand, SwerveModuleCommandArray
from robot_stack.contract import topics
from robot_stack.contract.frames import DRIVE_AXES, JOINTS, STEER_AXES
from robot_stack.core.robot import load_robot
from robot_stack.core.runtime import runtime_dir
from robot_stack.middleware.conversions import time_from_s, time_to_s
from robot_stack.wmx import MotionEngine
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.simulated.channel import StatusView
from robot_stack.wmx.simulated.server import SOCKET_FILE
from tests.support.braking import braking_s
from tests.support.held_up import HeldUp
from tests.support.peer import Heard, Peer
from tests.support.processes import ROOT, NodeProcess
from tests.support.waiting import DEADLINE_S, wait_for

ROBOT = load_robot()
RADIUS_M = ROBOT.wheel_radius_m
WELL = {"safety_state": SafetyStatus.NORMAL}
EMERGENCY = {"safety_state": SafetyStatus.EMERGENCY_STOP}


def wheel_commands(speed_mps: float, angle_rad: float = 0.0, stamp_s: float = 0.0) -> SwerveModuleCommandArray:
    message = SwerveModuleCommandArray(
        modules=[SwerveModuleCommand(module_id=i, drive_velocity=speed_mps, steering_angle=angle_rad) for i in range(4)]
    )
    message.header.stamp = time_from_s(stamp_s)
    return message


class Rig:
    """Engine, node, and everything the node listens to."""

    def __init__(self, start: Callable[..., NodeProcess], peer: Peer, folder: Path) -> None:
        self.start, self.peer = start, peer
        self.orders = folder / "orders.json"
        self.joints: Heard = peer.listen(topics.JOINT_STATES)
        self.engine: NodeProcess | None = None
        self.node: NodeProcess | None = None
        self.device: MotionEngine | None = None

    def start_engine(self) -> NodeProcess:
        not_before_ns = time.time_ns()
        script = ROOT / "tests" / "nodes" / "scripts" / "engine_with_faults.py"
        self.engine = self.start("engine", command=[sys.executable, str(script), str(self.orders)])
        socket = runtime_dir() / SOCKET_FILE
        wait_for(lambda: socket.exists() and socket.stat().st_ctime_ns >= not_before_ns, "the engine to listen", 60.0)
        return self.engine

    def start_node(self, *ros_args: str) -> NodeProcess:
        self.node = self.start("swerve_hardware_interface", *ros_args)
        for row in (topics.WHEEL_COMMANDS, topics.SAFETY_STATUS, topics.EMERGENCY_STOP):
            self.peer.wait_matched(row)
        return self.node

    def safety(self, fields: dict[str, object]) -> None:
        self.peer.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(**fields), 10.0)

    def command(self, speed_mps: float, angle_rad: float = 0.0) -> None:
        self.peer.repeat(topics.WHEEL_COMMANDS, lambda: wheel_commands(speed_mps, angle_rad), 20.0)

    def press(self) -> None:
        self.peer.publish(topics.EMERGENCY_STOP, Bool(data=True))

    def let_go(self) -> None:
        self.peer.publish(topics.EMERGENCY_STOP, Bool(data=False))

    def break_drives(self, **orders: object) -> None:
        fresh = self.orders.with_suffix(".new")
        fresh.write_text(json.dumps(orders), encoding="ascii")
        os.replace(fresh, self.orders)

    # What the engine itself says, past the node.

    def status(self) -> StatusSnapshot:
        return StatusView(runtime_dir(), 5.0).read()[1]

    def wait_status(self, holds: Callable[[StatusSnapshot], object], what: str) -> StatusSnapshot:
        view = StatusView(runtime_dir(), 5.0)

        def look() -> StatusSnapshot | None:
            code, snapshot = view.read()
            return snapshot if not code and snapshot.n_axes and holds(snapshot) else None

        found = wait_for(look, what, poll_s=0.001)
        assert found is not None
        return found

    def wait_servos(self, on: bool = True) -> None:
        self.wait_status(lambda s: (s.servo_on == on).all(), f"all servos {'on' if on else 'off'}")

    def wait_speed(self, speed_mps: float) -> None:
        """Until all four wheels really turn at this speed."""
        self.wait_status(lambda s: (abs(wheels_mps(s) - speed_mps) < 0.01).all(), f"wheels at {speed_mps} m/s")

    def ready(self) -> None:
        self.start_engine()
        self.safety(WELL)
        self.start_node()
        self.command(0.0)
        self.wait_servos()


def wheels_mps(snapshot: StatusSnapshot):
    return snapshot.actual_velocity[list(DRIVE_AXES)] * RADIUS_M


def wheels_m(snapshot: StatusSnapshot):
    return snapshot.actual_pos[list(DRIVE_AXES)] * RADIUS_M


def headings_rad(snapshot: StatusSnapshot):
    return snapshot.actual_pos[list(STEER_AXES)]


@pytest.fixture
def rig(start: Callable[..., NodeProcess], peer: Peer, tmp_path: Path) -> Iterator[Rig]:
    rig = Rig(start, peer, tmp_path)
    yield rig
    if rig.node is not None:
        rig.node.stop()  # before the engine: the end of the node is part of what is tested


# --- start ----------------------------------------------------------------------------------------------------


def test_joint_states_of_all_axes_at_their_rate(rig: Rig) -> None:
    rig.ready()
    rig.joints.items.clear()
    with HeldUp() as machine:
        wait_for(lambda: len(rig.joints.items) >= 101, "two seconds of joint states")
        age_s = time.time() - time_to_s(rig.joints.last.header.stamp)
    messages: list[JointState] = rig.joints.messages
    assert messages[-1].name == list(JOINTS)
    assert [len(field) for field in (messages[-1].position, messages[-1].velocity, messages[-1].effort)] == [8, 8, 8]
    stamps = [time_to_s(message.header.stamp) for message in messages]
    # The middle one: on a machine that is held up some ticks come late or not at all.
    assert statistics.median(later - earlier for earlier, later in pairwise(stamps)) == pytest.approx(0.02, rel=0.02)
    assert -0.1 < age_s < 0.5 + machine.seconds


def test_engine_that_comes_late_is_waited_for(rig: Rig) -> None:
    rig.safety(WELL)
    node = rig.start_node()
    node.wait_output("waiting for the motion engine")
    assert rig.joints.items == []
    rig.start_engine()
    rig.wait_servos()
    rig.joints.wait(lambda _: True, "joint states")


def test_servos_wait_for_the_safety_monitor(rig: Rig) -> None:
    rig.start_engine()
    rig.start_node()
    rig.joints.wait(lambda _: True, "joint states")  # of standing wheels, servos off
    rig.node.wait_output("waiting for the safety monitor")
    rig.safety(EMERGENCY)
    rig.node.wait_output("emergency stop")
    count = len(rig.joints.items)
    wait_for(lambda: len(rig.joints.items) > count + 25, "half a second of joint states")
    assert not rig.status().servo_on.any()
    rig.safety(WELL)
    rig.wait_servos()


# --- motion ----------------------------------------------------------------------------------------------------


def test_wheels_turn_as_commanded(rig: Rig) -> None:
    rig.ready()
    rig.command(0.4, 0.5)
    rig.wait_speed(0.4)
    rig.wait_status(lambda s: (abs(headings_rad(s) - 0.5) < 1e-3).all(), "headings at 0.5 rad")
    count = len(rig.joints.items)
    wait_for(lambda: len(rig.joints.items) > count + 2, "the joint states of now")
    message = rig.joints.last
    assert message.velocity[0::2] == pytest.approx([0.4 / RADIUS_M] * 4, rel=0.05)
    assert message.position[1::2] == pytest.approx([0.5] * 4, abs=1e-3)


def test_headings_go_on_turning_through_the_wrap(rig: Rig) -> None:
    """Commands wrapped to +-pi, twice around in small steps: the axes accumulate two turns."""
    rig.ready()
    for step in range(1, 43):
        angle = 0.3 * step
        rig.command(0.0, math.remainder(angle, 2.0 * math.pi))
        rig.wait_status(
            lambda s, angle=angle: (abs(headings_rad(s) - angle) < 0.02).all(), f"headings at {angle:.1f} rad"
        )
    assert headings_rad(rig.status()).min() > 2.0 * 2.0 * math.pi


def test_silence_of_the_controller_stops_the_wheels(rig: Rig) -> None:
    rig.ready()
    rig.command(0.6)
    rig.wait_speed(0.6)
    rig.peer.silence(topics.WHEEL_COMMANDS)
    with HeldUp() as machine:
        silent_s = time.monotonic()
        rig.wait_status(lambda s: (s.velocity_cmd[list(DRIVE_AXES)] < 0.59 / RADIUS_M).all(), "wheels slowing down")
        began_s = time.monotonic() - silent_s
        rig.wait_speed(0.0)
        took_s = time.monotonic() - silent_s
    assert 0.05 < began_s < 0.4 + machine.seconds  # 0.15 s after the last command, which is up to 0.05 s old
    assert took_s - began_s > 0.2 - machine.seconds  # 0.6 m/s at 2.0 m/s2 is 0.3 s: no leap
    rig.node.wait_output("no usable /swerve/wheel_commands for 0.15 s")
    rig.command(0.3)
    rig.wait_speed(0.3)


BAD_COMMANDS: dict[str, Callable[[SwerveModuleCommandArray], None]] = {
    "drive_velocity of fr must be within +-2.475 m/s, is nan": lambda m: setattr(
        m.modules[1], "drive_velocity", math.nan
    ),
    "drive_velocity of fl must be within +-2.475 m/s, is 50.0": lambda m: setattr(m.modules[0], "drive_velocity", 50.0),
    "steering_angle of rr must be within +-pi rad, is inf": lambda m: setattr(m.modules[3], "steering_angle", math.inf),
    "module_id must be 0..3, each once, is 0, 1, 1, 3": lambda m: setattr(m.modules[2], "module_id", 1),
    "header.stamp is 5.0": lambda m: setattr(m.header, "stamp", time_from_s(time.time() - 5.0)),
}


def test_bad_commands_are_refused_and_the_wheels_stop(rig: Rig) -> None:
    rig.ready()
    for says, broken in BAD_COMMANDS.items():
        rig.command(0.4)
        rig.wait_speed(0.4)

        def bad(broken: Callable[[SwerveModuleCommandArray], None] = broken) -> SwerveModuleCommandArray:
            message = wheel_commands(0.4)
            broken(message)
            return message

        rig.peer.repeat(topics.WHEEL_COMMANDS, bad, 20.0)
        rig.wait_speed(0.0)
        rig.node.wait_output(f"/swerve/wheel_commands refused: {says}")


# --- emergency stop
# ----------------------------------------------------------------------------------------------------


def test_emergency_stop_reaches_the_engine_at_once(rig: Rig) -> None:
    rig.ready()
    delays_ms = []
    for _ in range(5):
        rig.command(0.4)
        rig.wait_speed(0.4)
        pressed_s = time.monotonic()
        rig.press()
        stopped = rig.wait_status(lambda s: s.emergency_stop, "the engine's emergency stop")
        delays_ms.append(1e3 * (time.monotonic() - pressed_s))
        assert stopped.servo_on.all()
        rig.wait_speed(0.0)
        rig.safety(EMERGENCY)
        rig.node.wait_output("emergency stop")
        rig.let_go()
        release(rig)
    assert statistics.median(delays_ms) < 20.0


def release(rig: Rig) -> None:
    """The emergency has been in the status long enough to be seen; then it is over."""
    count = len(rig.joints.items)
    wait_for(lambda: len(rig.joints.items) > count + 15, "0.3 s of joint states")
    rig.safety(WELL)
    rig.wait_status(lambda s: not s.emergency_stop and s.servo_on.all(), "the release in the engine")


def test_emergency_stop_decelerates_as_configured(rig: Rig) -> None:
    rig.ready()
    rig.command(1.0)
    rig.wait_speed(1.0)
    rig.press()
    # 1.0 m/s at 2.0 m/s2.
    assert braking_s(rig.wait_status, DRIVE_AXES[0], 1.0 / RADIUS_M) == pytest.approx(0.5, rel=0.02)


def test_wheels_stand_until_both_keys_and_a_fresh_command(rig: Rig) -> None:
    rig.ready()
    rig.command(0.3)
    rig.wait_speed(0.3)
    rig.press()
    rig.wait_speed(0.0)
    rig.let_go()
    stays_stopped(rig)  # the monitor has not said anything yet
    rig.safety(EMERGENCY)
    stays_stopped(rig)
    rig.peer.silence(topics.WHEEL_COMMANDS)
    release(rig)
    count = len(rig.joints.items)
    wait_for(lambda: len(rig.joints.items) > count + 15, "0.3 s of joint states")
    assert not rig.status().velocity_cmd.any()
    rig.command(0.3)
    rig.wait_speed(0.3)


def stays_stopped(rig: Rig) -> None:
    count = len(rig.joints.items)
    wait_for(lambda: len(rig.joints.items) > count + 25, "half a second of joint states")
    snapshot = rig.status()
    assert snapshot.emergency_stop
    assert not snapshot.velocity_cmd.any()


def test_emergency_stop_without_an_engine_holds_when_it_comes(rig: Rig) -> None:
    rig.safety(WELL)
    node = rig.start_node()
    rig.press()
    node.wait_output("no engine to stop")
    rig.start_engine()
    rig.wait_status(lambda s: s.emergency_stop, "the engine's emergency stop")
    assert not rig.status().servo_on.any()


# --- faults ----------------------------------------------------------------------------------------------------


def test_alarm_of_one_drive_stops_all_until_an_emergency_stop_is_released(rig: Rig) -> None:
    rig.ready()
    rig.command(0.5)
    rig.wait_speed(0.5)
    rig.break_drives(alarms={"3": 33}, stubborn=True)
    rig.wait_status(lambda s: s.emergency_stop, "the engine's emergency stop")
    rig.wait_speed(0.0)
    rig.node.wait_output("fr_steer alarm 33")
    rig.break_drives()
    count = len(rig.joints.items)
    wait_for(lambda: len(rig.joints.items) > count + 40, "0.8 s of joint states")
    assert rig.status().amp_alarm[3]  # nobody clears it before somebody has looked
    rig.safety(EMERGENCY)
    rig.wait_status(lambda s: not s.amp_alarm.any(), "the alarm to be cleared")
    assert not rig.status().servo_on[3]
    release(rig)
    rig.wait_speed(0.5)


def test_lost_bus_silences_the_joint_states_and_comes_back_through_a_release(rig: Rig) -> None:
    rig.ready()
    rig.command(0.4)
    rig.wait_speed(0.4)
    rig.break_drives(connected=False)
    rig.wait_status(lambda s: not s.communicating, "the loss of the bus")
    rig.node.wait_output("communication with the drives is lost")
    count = len(rig.joints.items)
    rig.safety(EMERGENCY)
    rig.break_drives()
    rig.wait_status(lambda s: s.communicating and s.emergency_stop, "communication and the engine's emergency stop")
    assert not rig.status().servo_on.any()
    wait_for(lambda: len(rig.joints.items) > count, "joint states again")
    release(rig)
    rig.wait_speed(0.4)


def test_joint_states_are_silent_without_a_bus(rig: Rig) -> None:
    rig.ready()
    rig.joints.wait(lambda _: True, "joint states")
    rig.break_drives(connected=False)
    rig.node.wait_output("communication with the drives is lost")
    count, engine_s = len(rig.joints.items), rig.status().engine_time_s
    rig.wait_status(lambda s: s.engine_time_s > engine_s + 0.5, "half a second without a bus")
    assert len(rig.joints.items) <= count + 1  # one may have been on its way


def test_killed_engine_is_found_again(rig: Rig) -> None:
    rig.ready()
    rig.command(0.4)
    rig.wait_speed(0.4)
    assert rig.engine is not None
    rig.engine.process.kill()
    rig.engine.process.wait()
    rig.node.wait_output("waiting for the motion engine")
    count = len(rig.joints.items)
    rig.start_engine()
    rig.wait_servos()
    assert len(rig.joints.items) > count
    rig.wait_speed(0.4)


# --- end ----------------------------------------------------------------------------------------------------


def test_end_stops_the_wheels_and_closes_the_brakes(rig: Rig) -> None:
    rig.ready()
    rig.command(0.5)
    rig.wait_speed(0.5)
    watcher = watch_engine(rig)
    rig.node.signal(signal.SIGTERM)
    assert rig.node.wait() == 0
    assert not watcher()
    rig.wait_servos(on=False)


def watch_engine(rig: Rig) -> Callable[[], bool]:
    """A device of its own, so that the engine outlives the node. The result: is a wheel commanded still?

    The limit on the status's age only finds an engine that has ended: one that waits for a processor is read again.
    """
    from robot_stack.wmx import connect

    rig.device = connect("test")
    view = StatusView(runtime_dir(), DEADLINE_S)

    def moving() -> bool:
        code, snapshot = view.read()
        assert not code
        return bool(snapshot.velocity_cmd.any())

    return moving


def test_killed_interface_leaves_no_wheel_turning(rig: Rig) -> None:
    rig.ready()
    rig.command(0.5)
    rig.wait_speed(0.5)
    moving = watch_engine(rig)
    assert moving()
    rig.node.process.kill()
    wait_for(lambda: not moving(), "standstill")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "hung"])
def test_way_of_the_wheels_without_their_interface(rig: Rig, number: signal.Signals) -> None:
    """At 1.0 m/s, the rest of its last command's time and the braking: the engine needs nobody for it.

    The headings are held by the engine, where they were.
    """
    rig.ready()
    rig.command(1.0)
    rig.wait_speed(1.0)
    moving = watch_engine(rig)
    rig.node.signal(number)
    # After the signal: until then the interface commands, however long this process waits for a processor.
    begun = rig.status()
    wait_for(lambda: not moving(), "standstill")
    rig.wait_speed(0.0)
    distance_m = (wheels_m(rig.status()) - wheels_m(begun)).max()
    held = abs(headings_rad(rig.status()) - headings_rad(begun)).max()
    took_s = rig.status().engine_time_s - begun.engine_time_s
    print(f"interface {number.name}: {distance_m:.3f} m, watched for {took_s:.2f} s of the engine's time")
    try:
        assert distance_m < 0.5 * 1.0**2 / ROBOT.emergency_deceleration_mps2 + 0.25 * 1.0
        assert held < 1e-3
        assert rig.status().servo_on.all()
    finally:
        rig.node.signal(signal.SIGCONT if number is signal.SIGSTOP else signal.SIGKILL)


def test_second_interface_refuses_to_start(rig: Rig) -> None:
    rig.start_node()
    second = rig.start("swerve_hardware_interface")
    assert second.wait() == 2
    assert "swerve_hardware_interface is already running" in second.output()


@pytest.mark.parametrize(
    ("argument", "says"),
    [
        ("steering_periods:=0.5", "steering_periods: Input should be greater than or equal to 1"),
        ("command_lifetime_s:=0.15", "command_lifetime_s must be above 0.15"),
    ],
)
def test_wrong_parameters_end_the_start(start: Callable[..., NodeProcess], argument: str, says: str) -> None:
    process = start("swerve_hardware_interface", "-p", argument)
    assert process.wait() == 2
    assert says in process.output()

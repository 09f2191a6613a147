"""manipulator_state on a real engine process with six virtual joints: start, joint states, losses and the end."""

from __future__ import annotations

import itertools
import signal
import statistics
import struct
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from std_msgs.msg import Bool

from robot_stack.contract import topics
from robot_stack.middleware.interfaces import interface_class
from robot_stack.wmx.api import ErrorCode, Motion_PosCommand, Profile
from robot_stack.wmx.axes import Flag, StatusSnapshot
from robot_stack.wmx.config import ENGINE_CONFIG_VARIABLE
from tests.support.engine import TestEngine
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.peer import Heard, Peer

Start = Callable[..., NodeProcess]
NAME = "manipulator_state"
NAMES = ["joint1", "joint2", "joint3", "joint4", "joint5", "joint6", "picker_1_joint", "picker_2_joint"]
OPEN, CLOSED = 0.0, 0.045
QUICK = ("-p", "session.attempt_pause_s:=0.1", "-p", "session.communication_retry_s:=1.0")


@pytest.fixture(autouse=True)
def _six_joints(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ENGINE_CONFIG_VARIABLE, "wmx_engine_manipulator")


@pytest.fixture
def engine(start: Start, tmp_path: Path, _six_joints: None) -> Iterator[TestEngine]:
    engine = TestEngine(start, tmp_path)
    yield engine
    engine.close()


class Manipulator:
    """The node and its published messages."""

    def __init__(self, start: Start, peer: Peer, *ros_args: str) -> None:
        self.joints: Heard = peer.listen(topics.WMX_JOINT_STATES)
        self._beats = peer.listen(topics.HEARTBEAT)
        self.process = start(NAME, *QUICK, *ros_args)

    def wait_health(self, text: str) -> None:
        """Waits for a heartbeat with ``text``; empty means ready."""

        def matches() -> bool:
            last = self._beats.last
            if last is None or last.node != NAME:
                return False
            return text in last.waiting_for if text else last.ready

        wait_for(matches, f"the node to be {text or 'ready'}", 60.0)

    def wait_up(self) -> Any:
        self.wait_health("")
        return self.joints.wait(lambda _: True, "joint states")

    def wait_silent(self) -> None:
        """Checks that no joint state arrives for half a second, which is 250 periods."""
        wait_for(lambda: time.monotonic() - self.joints.items[-1][0] > 0.5, "silence")

    def wait_news(self) -> Any:
        count = len(self.joints.items)
        wait_for(lambda: len(self.joints.items) > count, "joint states again")
        return self.joints.last


def status(engine: TestEngine) -> StatusSnapshot:
    return engine.device.read_status()[1]


def test_every_joint_state_is_newer_than_the_one_before(start: Start, peer: Peer, engine: TestEngine) -> None:
    engine.run()
    stamps_s: list[float] = []

    def on_bytes(data: bytes) -> None:
        seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
        stamps_s.append(seconds + 1e-9 * nanoseconds)

    row = topics.WMX_JOINT_STATES
    peer.node.create_subscription(interface_class(row.type), row.name, on_bytes, 500, raw=True)
    start(NAME, *QUICK)
    wait_for(lambda: len(stamps_s) > 600, "600 joint states")
    periods_s = [b - a for a, b in itertools.pairwise(stamps_s[100:])]
    assert min(periods_s) > 0.0


def test_joint_states(start: Start, peer: Peer, engine: TestEngine) -> None:
    engine.run()
    isaac, gazebo = peer.listen(topics.ISAAC_JOINT_COMMAND), peer.listen(topics.GAZEBO_COMMANDS)
    node = Manipulator(
        start, peer, "-p", "isaacsim_joint_topic:=/isaacsim/joint_command", "-p", "joint_feedback_rate:=100"
    )
    message = node.wait_up()
    assert list(message.name) == NAMES
    assert message.header.frame_id == ""
    assert list(message.effort) == []
    assert len(message.position) == len(message.velocity) == 8

    # measured values of a motion, equal on all topics
    profile = Profile.SetupTrapezoidal(0.5, 2.0, 2.0)
    assert engine.device.core_motion.motion.StartPos(Motion_PosCommand(2, 0.4, profile)) == 0
    node.joints.wait(lambda m: abs(m.position[2] - 0.4) < 1e-6 and m.velocity[2] == 0.0, "joint3 to arrive")
    moving = [m for m in node.joints.messages if m.velocity[2] > 0.4]
    assert moving
    assert all(0.0 < m.position[2] < 0.4 for m in moving)
    assert all(list(m.velocity[6:]) == [0.0, 0.0] for m in node.joints.messages)
    last = gazebo.wait(lambda m: abs(m.data[2] - 0.4) < 1e-6, "the Gazebo positions")
    assert list(last.data) == pytest.approx(list(node.joints.last.position), abs=2e-6)
    mirrored = isaac.wait(lambda m: abs(m.position[2] - 0.4) < 1e-6, "the Isaac Sim states")
    assert list(mirrored.name) == NAMES
    assert (mirrored.header.stamp.sec, mirrored.header.stamp.nanosec) == (0, 0)

    # the gripper's output bit
    assert list(last.data[6:]) == [OPEN, OPEN]
    assert engine.device.io.SetOutBit(0, 0, 1) == 0
    node.joints.wait(lambda m: list(m.position[6:]) == [CLOSED, CLOSED], "closed fingers")
    gazebo.wait(lambda m: list(m.data[6:]) == [CLOSED, CLOSED], "closed fingers for Gazebo")
    assert engine.device.io.SetOutBit(0, 1, 1) == 0
    assert engine.device.io.SetOutBit(0, 0, 0) == 0
    node.joints.wait(lambda m: list(m.position[6:]) == [OPEN, OPEN], "open fingers")


def test_names_and_options(start: Start, peer: Peer, engine: TestEngine) -> None:
    engine.run()
    node = Manipulator(
        start,
        peer,
        *("-p", "isaacsim_joint_topic:=/isaacsim/joint_command", "-p", "isaacsim_stamp:=true"),
        *("-p", "gazebo_joint_topic:=/gazebo_joint_topic/no_param", "-p", "encoder_joint_topic:=/arm/joint_states"),
        *("-p", "joint_feedback_rate:=100", "-p", "auto_servo_on:=false", "-p", "gripper_bit:=1"),
    )
    isaac = peer.listen(topics.ISAAC_JOINT_COMMAND)
    first = isaac.wait(lambda _: True, "the Isaac Sim states")
    assert first.header.stamp.sec > 0
    names = [name for name, _ in peer.node.get_topic_names_and_types() if peer.node.count_publishers(name)]
    assert "/arm/joint_states" in names
    assert not {"/joint_states", "/gazebo_position_controller/commands", "/gazebo_joint_topic/no_param"} & set(names)
    assert engine.device.io.SetOutBit(0, 1, 1) == 0
    isaac.wait(lambda m: list(m.position[6:]) == [CLOSED, CLOSED], "closed fingers")
    wait_for(lambda: len(isaac.items) > 100, "100 messages")
    stamps = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in isaac.messages]
    assert statistics.median(b - a for a, b in itertools.pairwise(stamps)) == pytest.approx(0.01, abs=1e-3)
    node.wait_health("")  # ready although the servos are off
    assert not status(engine).servo_on.any()


def test_a_killed_engine_is_silence_and_its_successor_a_new_start(
    start: Start, peer: Peer, engine: TestEngine, tmp_path: Path
) -> None:
    engine.run()
    node = Manipulator(start, peer)
    node.wait_up()
    engine.kill()
    node.wait_silent()
    node.wait_health("waiting for the motion engine")
    assert node.process.running()
    assert "the motion engine has ended" in node.process.output()
    successor = TestEngine(start, tmp_path).run()
    node.wait_news()
    node.wait_health("")
    assert status(successor).servo_on.all()
    successor.close()


def test_no_servo_comes_on_during_an_emergency_stop(start: Start, peer: Peer, engine: TestEngine) -> None:
    node = Manipulator(start, peer)
    peer.wait_matched(topics.EMERGENCY_STOP)
    peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
    node.wait_health("waiting for the motion engine")
    engine.run()
    node.wait_health("emergency stop")
    node.wait_news()
    assert not status(engine).servo_on.any()


def test_the_end_takes_back_what_the_start_took(start: Start, peer: Peer, engine: TestEngine) -> None:
    engine.run()
    node = Manipulator(start, peer)
    node.wait_up()
    profile = Profile.SetupTrapezoidal(1.0, 5.0, 5.0)
    assert engine.device.core_motion.motion.StartPos(Motion_PosCommand(0, 100.0, profile)) == 0
    node.joints.wait(lambda m: m.velocity[0] > 0.5, "joint1 to move")
    node.process.signal(signal.SIGINT)
    assert node.process.wait() == 0
    assert "stopping joint1" in node.process.output()
    assert status(engine).flags[Flag.END_REASON, 0] == ErrorCode.PyNone  # stopped, and not by switching its servo off
    assert not status(engine).servo_on.any()
    assert status(engine).communicating  # other processes have devices

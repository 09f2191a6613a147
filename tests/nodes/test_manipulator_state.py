"""manipulator_state on a real engine process with six virtual joints: start, joint states, losses and the end."""

from __future__ import annotations

import itertools
import signal
import struct
import time
from collections.abc import Iterator
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
from tests.support.processes import Start
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.peer import Peer, Received

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
        self.joints: Received = peer.listen(topics.WMX_JOINT_STATES)
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


def test_joint_states(start: Start, peer: Peer, engine: TestEngine) -> None:
    engine.run()
    stamps: list[tuple[int, int]] = []
    row = topics.WMX_JOINT_STATES
    peer.node.create_subscription(
        interface_class(row.type),
        row.name,
        lambda data: stamps.append(struct.unpack_from("<iI", data, 4)),
        500,
        raw=True,
    )
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
    wait_for(lambda: len(stamps) > 200, "200 joint states")
    assert all(after > before for before, after in itertools.pairwise(stamps)), "each is newer than the one before"


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

    def published() -> set[str]:
        return {name for name, _ in peer.node.get_topic_names_and_types() if peer.node.count_publishers(name)}

    wait_for(lambda: "/arm/joint_states" in published(), "the renamed topic")
    assert not published() & {"/joint_states", "/gazebo_position_controller/commands", "/gazebo_joint_topic/no_param"}
    assert engine.device.io.SetOutBit(0, 1, 1) == 0
    isaac.wait(lambda m: list(m.position[6:]) == [CLOSED, CLOSED], "closed fingers")
    node.wait_health("")  # ready although the servos are off
    assert not status(engine).servo_on.any()


def test_a_killed_engine_is_silence_its_successor_a_new_start_and_the_end_stops_the_joints(
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

    # The end takes back what the start took.
    profile = Profile.SetupTrapezoidal(1.0, 5.0, 5.0)
    assert successor.device.core_motion.motion.StartPos(Motion_PosCommand(0, 100.0, profile)) == 0
    node.joints.wait(lambda m: m.velocity[0] > 0.5, "joint1 to move")
    node.process.signal(signal.SIGINT)
    assert node.process.wait() == 0
    assert "stopping joint1" in node.process.output()
    end = status(successor)
    assert end.flags[Flag.END_REASON, 0] == ErrorCode.PyNone  # stopped, and not by switching its servo off
    assert not end.servo_on.any()
    assert end.communicating  # other processes have devices
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

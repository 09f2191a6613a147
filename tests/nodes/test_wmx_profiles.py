"""The profiles of the motion-engine layer, started by the supervisor and tested through their interfaces."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectoryPoint

from control_msgs.action import FollowJointTrajectory
from custom_msgs.srv import InjectFault
from robot_stack.contract import actions, services, topics
from robot_stack.contract.model import Service
from robot_stack.supervisor import client
from robot_stack.supervisor.control import ask
from tests.support.compiled import assert_set_up_compiled_everything, tell_what_is_compiled
from tests.support.processes import ROOT
from tests.support.waiting import wait_for
from wmx_ros2_message.msg import AxisPose
from wmx_ros2_message.srv import SetAxis

if TYPE_CHECKING:
    from tests.support.peer import Heard, Peer

JOINTS = ["joint1", "joint2", "joint3", "joint4", "joint5", "joint6"]
FINGERS = ["picker_1_joint", "picker_2_joint"]
SUCCEEDED, ABORTED = 4, 6
AXIS_AMP_ALARM = 1568


@pytest.fixture
def up(ros_domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., dict[str, Any]]]:
    """Starts a profile and returns the supervisor's status with every process ready."""
    tell_what_is_compiled(monkeypatch)

    def start(profile: str, *settings: str) -> dict[str, Any]:
        return client.start(client.Launch(profile, settings=settings, log_dir=tmp_path / "logs"), 90.0)

    yield start
    client.stop()
    assert_set_up_compiled_everything(tmp_path / "logs")


def inject(peer: Peer, row: Service, kind: str, target: str = "", duration_s: float = 0.0) -> None:
    answer = peer.call(row, InjectFault.Request(kind=kind, target=target, duration_s=duration_s))
    assert answer.success, answer.message


def operate(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Runs the real command line."""
    command = [sys.executable, "-m", "robot_stack.cli", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60.0, check=False)


class Arm:
    """The arm's interface for a motion planner, and its true position."""

    def __init__(self, peer: Peer) -> None:
        from rclpy.action import ActionClient

        self.peer = peer
        self.states: Heard = peer.listen(topics.WMX_JOINT_STATES)
        self.truth: Heard = peer.listen(topics.SIM_JOINT_STATES)
        self._client = ActionClient(peer.node, FollowJointTrajectory, actions.FOLLOW_JOINT_TRAJECTORY.name)
        wait_for(self._client.server_is_ready, "the action")
        self.states.wait(lambda _: True, "joint states")
        self.truth.wait(lambda _: True, "the truth")

    def send(self, *waypoints: tuple[int, list[float]]) -> Any:
        """Sends waypoints (seconds, positions) and returns the future of the result."""
        goal = FollowJointTrajectory.Goal()
        goal.trajectory.joint_names = JOINTS
        goal.trajectory.points = [
            JointTrajectoryPoint(positions=positions, time_from_start=Duration(sec=seconds))
            for seconds, positions in waypoints
        ]
        sent = self.peer.in_loop(lambda: self._client.send_goal_async(goal))
        wait_for(sent.done, "an answer to the goal")
        assert sent.result().accepted
        return self.peer.in_loop(sent.result().get_result_async)

    @property
    def true_positions(self) -> np.ndarray:
        return np.array(self.truth.last.position)

    @property
    def moving(self) -> bool:
        return float(np.abs(np.array(self.truth.last.velocity)[:6]).max()) > 0.2

    @property
    def stands(self) -> bool:
        """True once the arm has settled: creeping at 0.01 rad/s would continue for several thousandths of a radian."""
        return float(np.abs(np.array(self.truth.last.velocity)[:6]).max()) < 0.001


def test_the_arm_follows_a_trajectory_grasps_and_stops_for_an_alarm(up: Callable[..., Any], peer: Peer) -> None:
    status = up("manipulator")
    assert status["ready"]
    assert not status["missing"]
    arm = Arm(peer)
    assert arm.states.last.name == arm.truth.last.name == [*JOINTS, *FINGERS]
    target = [0.4, 0.3, 0.5, -0.2, 0.6, 0.3]
    result = arm.send((1, target))
    wait_for(result.done, "the end of the trajectory")
    assert (result.result().status, result.result().result.error_code) == (SUCCEEDED, 0)
    assert arm.true_positions[:6] == pytest.approx(target, abs=0.002)
    assert arm.states.last.position[:6] == pytest.approx(arm.true_positions[:6], abs=0.001)

    assert peer.call(services.SET_GRIPPER, SetBool.Request(data=True)).message == "Gripper closed successfully"
    wait_for(lambda: arm.true_positions[6:] == pytest.approx([0.045, 0.045], abs=0.001), "the fingers to close")
    assert list(arm.states.last.position[6:]) == [0.045, 0.045]

    result = arm.send((4, [0.0] * 6))
    wait_for(lambda: arm.moving, "motion")
    inject(peer, services.INJECT_ARM_FAULT, "drive_alarm", "joint2", duration_s=0.1)
    wait_for(result.done, "the end of the trajectory")
    assert result.result().status == ABORTED
    assert result.result().result.error_code == AXIS_AMP_ALARM
    assert "joint2" in result.result().result.error_string
    wait_for(lambda: arm.stands, "the arm to stand")
    assert np.abs(arm.true_positions[:6]).max() > 0.1  # during the motion


def test_a_bus_that_drops_in_motion_ends_the_trajectory_and_the_arm_stands(up: Callable[..., Any], peer: Peer) -> None:
    up("manipulator")
    arm = Arm(peer)
    result = arm.send((3, [1.5, 0.5, 0.5, 0.0, 0.0, 0.0]))
    wait_for(lambda: arm.moving, "motion")
    inject(peer, services.INJECT_ARM_FAULT, "bus_loss")
    wait_for(result.done, "the end of the trajectory")
    assert result.result().status == ABORTED
    assert result.result().result.error_code > 0
    wait_for(lambda: arm.stands, "the arm to stand")
    silent_since = len(arm.states.items)
    stood = arm.true_positions[:6]
    assert 0.01 < stood[0] < 1.49
    arm.truth.items.clear()
    wait_for(lambda: len(arm.truth.items) > 10, "more of the truth")
    assert arm.true_positions[:6] == pytest.approx(stood, abs=1e-3)
    assert len(arm.states.items) == silent_since  # no stale state is published

    # Communication recovers by itself; an operator must permit further motion.
    inject(peer, services.INJECT_ARM_FAULT, "clear")
    wait_for(lambda: len(arm.states.items) > silent_since, "joint states again")
    assert not ask("status")["ready"]
    axes, every = list(range(6)), [1] * 6
    assert peer.call(services.AXIS_CLEAR_ALARM, SetAxis.Request(index=axes)).success
    assert peer.call(services.AXIS_SET_ON, SetAxis.Request(index=axes, data=every)).success
    wait_for(lambda: ask("status")["ready"], "every process to be ready again")
    assert arm.true_positions[:6] == pytest.approx(stood, abs=1e-3)
    moved = operate("arm", "move", "--to=1.0,0.2,0.3,0,-0.5,0", "--in", "1")
    assert moved.returncode == 0, moved.stderr
    assert moved.stdout.splitlines()[-1].startswith("goal reached; at most ")
    arm.truth.items.clear()  # the newest of them may be older than the goal's end
    wait_for(lambda: arm.truth.items, "the truth")
    assert arm.true_positions[:6] == pytest.approx([1.0, 0.2, 0.3, 0.0, -0.5, 0.0], abs=0.002)
    assert operate("arm", "grip", "close").stdout == "Gripper closed successfully\n"


def test_the_differential_base_comes_up(up: Callable[..., Any]) -> None:
    status = up("diff_drive")
    assert status["ready"]
    assert not status["missing"]


def test_the_general_node_moves_the_axes_of_a_bench(up: Callable[..., Any], peer: Peer) -> None:
    status = up("general")
    assert not status["missing"]
    assert peer.call(services.ENGINE_SET_COMM, SetBool.Request(data=True)).message == "Communication is started"
    answer = peer.call(services.AXIS_SET_ON, SetAxis.Request(index=[0, 3], data=[1, 1]))
    assert answer.message == "Set axis 0 on; Set axis 3 on; "
    states = peer.listen(topics.WMX_AXIS_STATE)
    states.wait(lambda state: list(state.servo_on) == [1, 0, 0, 1], "servos 0 and 3 on")
    peer.wait_matched(topics.WMX_AXIS_POSITION)
    move = AxisPose(index=[0, 3], target=[1.5, -0.5], velocity=[5.0, 5.0], acc=[50.0, 50.0], dec=[50.0, 50.0])
    peer.publish(topics.WMX_AXIS_POSITION, move)
    arrived = states.wait(lambda state: math.isclose(state.actual_pos[0], 1.5, abs_tol=0.001), "axis 0 at 1.5 rad")
    states.wait(lambda state: math.isclose(state.actual_pos[3], -0.5, abs_tol=0.001), "axis 3 at -0.5 rad")
    assert len(arrived.actual_pos) == 4
    # Without a safety monitor the last /emergency_stop decides.
    turn_on = SetAxis.Request(index=[1], data=[1])
    stopped = operate("estop")
    assert (stopped.returncode, stopped.stdout[:21]) == (0, "emergency stop, sent;"), stopped.stderr
    wait_for(lambda: not peer.call(services.AXIS_SET_ON, turn_on).success, "the stop to be in force")
    assert operate("reset").stdout.startswith("released; this machine has no safety monitor")
    wait_for(lambda: peer.call(services.AXIS_SET_ON, turn_on).success, "the release")
    inject(peer, services.INJECT_ENGINE_FAULT, "drive_alarm", "axis3")
    states.wait(lambda state: list(state.amp_alarm) == [0, 0, 0, 1], "the alarm of axis 3")

"""The running profiles of the motion-engine layer: against the contract, and through their interfaces.

The simulated robot's: tests/scenarios/flat/test_graph.py, tests/scenarios/test_robot_profile.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Twist
from rclpy.time import Time
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectoryPoint

from control_msgs.action import FollowJointTrajectory
from custom_msgs.srv import InjectFault
from robot_stack.contract import actions, services, topics
from robot_stack.contract.model import Service, System
from robot_stack.core.config import config_dir, read_yaml
from robot_stack.supervisor import client
from robot_stack.supervisor.control import ask
from robot_stack.supervisor.profile import Plan, load_plan
from robot_stack.wmx.config import ENGINE_VARIABLE
from tests.support.command_line import cli
from tests.support.compiled import assert_set_up_compiled_everything, tell_what_is_compiled
from tests.support.graph import PEER, assert_graph_is_the_contracts
from tests.support.waiting import wait_for
from wmx_ros2_message.msg import AxisPose
from wmx_ros2_message.srv import SetAxis

if TYPE_CHECKING:
    from tests.support.peer import Peer, Received

JOINTS = ["joint1", "joint2", "joint3", "joint4", "joint5", "joint6"]
FINGERS = ["picker_1_joint", "picker_2_joint"]
SUCCEEDED, ABORTED = 4, 6
AXIS_AMP_ALARM = 1568


# The peer is not bound by the contract.
@pytest.fixture
def peer(ros_domain: int) -> Iterator[Peer]:
    from tests.support.peer import Peer

    made = Peer(PEER)
    yield made
    made.close()


@pytest.fixture
def up(peer: Peer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], Plan]]:
    """Starts a profile, whose processes become ready."""
    tell_what_is_compiled(monkeypatch)

    def start(profile: str, *settings: str) -> Plan:
        status = client.start(client.Launch(profile, settings=settings, log_dir=tmp_path / "logs"), 90.0)
        assert status["ready"]
        assert not status["missing"]
        plan = load_plan(profile)
        assert plan.machine is System.WMX
        return plan

    yield start
    client.stop()
    assert_set_up_compiled_everything(tmp_path / "logs")


def inject(peer: Peer, row: Service, kind: str, target: str = "", duration_s: float = 0.0) -> None:
    answer = peer.call(row, InjectFault.Request(kind=kind, target=target, duration_s=duration_s))
    assert answer.success, answer.message


class Arm:
    """The arm's interface for a motion planner, and its true position."""

    def __init__(self, peer: Peer) -> None:
        from rclpy.action import ActionClient

        self.peer = peer
        self.states: Received = peer.listen(topics.WMX_JOINT_STATES)
        self.truth: Received = peer.listen(topics.SIM_JOINT_STATES)
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

    def true_positions_now(self) -> np.ndarray:
        """Of a moment after the call: messages that were sent before it may arrive later."""
        after = self.peer.node.get_clock().now()
        return np.array(self.truth.wait(lambda state: Time.from_msg(state.header.stamp) > after, "the truth").position)

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


def test_the_arm_follows_trajectories_grasps_and_stands_after_a_lost_bus_and_an_alarm(
    up: Callable[[str], Plan], peer: Peer
) -> None:
    assert_graph_is_the_contracts(up("manipulator"))
    arm = Arm(peer)
    assert arm.states.last.name == arm.truth.last.name == [*JOINTS, *FINGERS]
    target = [0.4, 0.3, 0.5, -0.2, 0.6, 0.3]
    result = arm.send((1, target))
    wait_for(result.done, "the end of the trajectory")
    assert (result.result().status, result.result().result.error_code) == (SUCCEEDED, 0)
    assert arm.true_positions_now()[:6] == pytest.approx(target, abs=0.002)
    arm.states.wait(lambda state: state.position[:6] == pytest.approx(target, abs=0.003), "the measured positions")

    assert peer.call(services.SET_GRIPPER, SetBool.Request(data=True)).message == "Gripper closed successfully"
    wait_for(lambda: arm.true_positions[6:] == pytest.approx([0.045, 0.045], abs=0.001), "the fingers to close")
    assert list(arm.states.last.position[6:]) == [0.045, 0.045]

    # The bus drops in motion.
    result = arm.send((3, [1.5, 0.5, 0.5, 0.0, 0.0, 0.0]))
    wait_for(lambda: arm.moving, "motion")
    inject(peer, services.INJECT_ARM_FAULT, "bus_loss")
    wait_for(result.done, "the end of the trajectory")
    assert result.result().status == ABORTED
    assert result.result().result.error_code > 0
    wait_for(lambda: arm.stands, "the arm to stand")
    silent_since = len(arm.states.items)
    stood = arm.true_positions[:6]
    assert 0.41 < stood[0] < 1.49
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
    moved = cli("arm", "move", "--to=1.0,0.2,0.3,0,-0.5,0", "--in", "1")
    assert moved.returncode == 0, moved.stderr
    assert moved.stdout.splitlines()[-1].startswith("goal reached; at most ")
    assert arm.true_positions_now()[:6] == pytest.approx([1.0, 0.2, 0.3, 0.0, -0.5, 0.0], abs=0.002)
    assert cli("arm", "grip", "close").stdout == "Gripper closed successfully\n"

    # A drive has an alarm in motion.
    result = arm.send((4, [0.0] * 6))
    wait_for(lambda: arm.moving, "motion")
    inject(peer, services.INJECT_ARM_FAULT, "drive_alarm", "joint2", duration_s=0.1)
    wait_for(result.done, "the end of the trajectory")
    assert result.result().status == ABORTED
    assert result.result().result.error_code == AXIS_AMP_ALARM
    assert "joint2" in result.result().result.error_string
    wait_for(lambda: arm.stands, "the arm to stand")
    assert np.abs(arm.true_positions[:6]).max() > 0.1  # during the motion


def test_the_general_node_moves_the_axes_of_a_bench(up: Callable[[str], Plan], peer: Peer) -> None:
    plan = up("general")
    # None of its nodes starts it, and before that the axes have no state to publish.
    assert peer.call(services.ENGINE_SET_COMM, SetBool.Request(data=True)).message == "Communication is started"
    assert_graph_is_the_contracts(plan)
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
    stopped = cli("estop")
    assert (stopped.returncode, stopped.stdout[:21]) == (0, "emergency stop, sent;"), stopped.stderr
    wait_for(lambda: not peer.call(services.AXIS_SET_ON, turn_on).success, "the stop to be in force")
    assert cli("reset").stdout.startswith("released; this machine has no safety monitor")
    wait_for(lambda: peer.call(services.AXIS_SET_ON, turn_on).success, "the release")
    inject(peer, services.INJECT_ENGINE_FAULT, "drive_alarm", "axis3")
    states.wait(lambda state: list(state.amp_alarm) == [0, 0, 0, 1], "the alarm of axis 3")


def twist(linear_mps: float) -> Twist:
    message = Twist()
    message.linear.x = linear_mps
    return message


def test_an_alarm_of_the_differential_base_is_cleared_by_the_general_node(up: Callable[..., Plan], peer: Peer) -> None:
    """An operator's sequence: start, drive, an alarm, clear_alarm and set_on by service, drive on."""
    speeds = peer.listen(topics.WMX_WHEEL_VELOCITIES)
    ramps = [f"diff_drive_controller.{name}=0.2" for name in ("acc_time", "dec_time")]
    assert_graph_is_the_contracts(up("diff_drive", *ramps))
    config = read_yaml(config_dir() / "diff_drive_controller.yaml")
    turning = 0.5 / config["wheel_radius"]
    peer.repeat(topics.WMX_CMD_VEL, lambda: twist(0.0), 20.0)
    peer.wait_matched(topics.WMX_CMD_VEL)
    begun = len(speeds.items)
    wait_for(lambda: len(speeds.items) > begun + 100, "a second with the stick in its middle")
    peer.repeat(topics.WMX_CMD_VEL, lambda: twist(0.5), 20.0)
    speeds.wait(lambda m: m.data[0] == pytest.approx(turning, abs=0.1), "wheels turning")
    inject(peer, services.INJECT_ENGINE_FAULT, "drive_alarm", "left_wheel", duration_s=0.1)
    speeds.wait(lambda m: list(m.data) == pytest.approx([0.0, 0.0], abs=0.02), "both wheels at rest")
    wait_for(lambda: not ask("status")["ready"], "the fault in the status")
    peer.repeat(topics.WMX_CMD_VEL, lambda: twist(0.0), 20.0)
    axis = {"index": [0], "data": [1]}
    cleared = peer.call(services.AXIS_CLEAR_ALARM, SetAxis.Request(**axis))
    assert cleared.message == "Cleared alarm axis 0; "
    assert peer.call(services.AXIS_SET_ON, SetAxis.Request(**axis)).message == "Set axis 0 on; "
    wait_for(lambda: ask("status")["ready"], "the base to be ready again")
    peer.repeat(topics.WMX_CMD_VEL, lambda: twist(0.5), 20.0)
    speeds.wait(lambda m: m.data[0] == pytest.approx(turning, abs=0.1), "wheels turning again")


def test_every_other_profile_needs_the_vendors_engine() -> None:
    compared = {"manipulator", "general", "diff_drive", "sim", "robot_simulated"}
    others = {path.stem for path in (config_dir() / "profiles").glob("*.yaml")} - compared
    assert {load_plan(name).environment.get(ENGINE_VARIABLE) for name in others} == {"vendor"}

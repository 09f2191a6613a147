"""Mission manager and navigation controller together, on a robot without inertia: do they understand each other?"""

from __future__ import annotations

import signal
from pathlib import Path

import pytest
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from custom_msgs.msg import SafetyStatus, UICommand
from robot_stack.contract import topics
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, exp_se2
from robot_stack.middleware.conversions import pose_stamped, pose_to_msg, twist_from_msg, twist_to_msg
from tests.support.blind import BLIND
from tests.support.peer import Peer
from tests.support.processes import NodeProcess, node_command
from tests.support.waiting import wait_for

STEP_S = 0.02


class Yard:
    """The robot does what /cmd_vel says; its pose is known exactly."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.peer = Peer()
        self.pose, self.twist = IDENTITY, ZERO_TWIST
        self.driven_m = 0.0
        self.status = self.peer.listen(topics.MISSION_STATUS)
        self.goals = self.peer.listen(topics.GOAL_POSE)
        self.heartbeat = self.peer.listen(topics.HEARTBEAT)
        self.peer.listen(topics.CMD_VEL, self._on_cmd_vel)
        self.peer.repeat(topics.ODOM, self._step, 1.0 / STEP_S)
        self.peer.repeat(topics.CURRENT_POSE, lambda: pose_stamped(self.pose, "map", self._now()), 10.0)
        self.peer.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="NORMAL"), 10.0)
        self.nodes: dict[str, NodeProcess] = {}
        self.peer.publisher(topics.UI_COMMAND)

    def _now(self):
        return self.peer.node.get_clock().now().to_msg()

    def _on_cmd_vel(self, message: Twist) -> None:
        self.twist = twist_from_msg(message)

    def _step(self) -> Odometry:
        self.pose = self.pose.compose(exp_se2(self.twist, STEP_S))
        self.driven_m += self.twist.speed() * STEP_S
        message = Odometry()
        message.header.frame_id, message.header.stamp, message.child_frame_id = "odom", self._now(), "base_link"
        message.pose.pose, message.twist.twist = pose_to_msg(self.pose), twist_to_msg(self.twist)
        return message

    def launch(self, name: str, *arguments: str) -> None:
        node = NodeProcess(node_command(name, *arguments), self.folder / f"{name}.log")
        self.nodes[name] = node
        wait_for(
            lambda: not node.running() or any(m.pid == node.pid and m.ready for m in self.heartbeat.messages),
            f"{name} ready",
        )
        assert node.running(), node.output()

    def launch_mission_manager(self) -> None:
        self.launch("mission_manager", "-p", f"journal_file:={self.folder / 'mission.db'}")

    def kill(self, name: str) -> None:
        self.nodes[name].signal(signal.SIGKILL)
        self.nodes[name].wait()

    def command(self, name: str, mission_id: str = "") -> None:
        self.peer.wait_matched(topics.UI_COMMAND)
        self.peer.publish(topics.UI_COMMAND, UICommand(command_type=name, mission_id=mission_id))
        self.status.wait(lambda status: status.last_command == name, f"an answer to {name}")
        assert self.status.last.last_command_accepted, self.status.last.reason

    def close(self) -> None:
        for node in self.nodes.values():
            node.stop()
        self.peer.close()


@pytest.fixture
def yard(ros_domain: int, tmp_path: Path):
    made = Yard(tmp_path)
    yield made
    made.close()


def assert_at_the_end(yard: Yard) -> None:
    """The last waypoint of short_hop: (4.5, 1.5) at 45 deg."""
    assert abs(yard.pose.x - 4.5) <= 0.05
    assert abs(yard.pose.y - 1.5) <= 0.05
    assert abs(yard.pose.yaw - 0.7854) <= 0.0349


def test_a_ride_ends_at_its_last_waypoint(yard):
    yard.launch("navigation_controller", *BLIND)
    yard.launch_mission_manager()
    yard.command("START_MISSION", "short_hop")
    done = yard.status.wait(lambda status: status.state in ("COMPLETED", "FAILED"), "the end of the ride", 40.0)
    assert done.state == "COMPLETED", done.reason
    assert_at_the_end(yard)
    assert yard.driven_m < 5.2, "on the way, not around it: the route is 4.9 m long"
    etas = [status.eta_s for status in yard.status.messages if status.eta_s == status.eta_s]
    assert etas
    assert all(0.0 <= eta_s < 60.0 for eta_s in etas)
    shares = [status.progress for status in yard.status.messages if status.state in ("RUNNING", "WAITING")]
    assert shares == sorted(shares)


def test_pause_stands_and_resume_goes_on(yard):
    yard.launch("navigation_controller", *BLIND)
    yard.launch_mission_manager()
    yard.command("START_MISSION", "short_hop")
    wait_for(lambda: yard.pose.x > 0.5, "half a metre")
    yard.command("PAUSE")
    wait_for(lambda: yard.twist.speed() < 1e-6, "standstill")
    stood = yard.pose
    yard.command("RESUME")
    wait_for(lambda: yard.pose.distance_to(stood) > 0.2, "going on")
    yard.status.wait(lambda status: status.state == "COMPLETED", "the end of the ride", 40.0)
    assert_at_the_end(yard)


def test_a_killed_navigation_controller_is_told_the_goal_again(yard):
    yard.launch("navigation_controller", *BLIND)
    yard.launch_mission_manager()
    yard.command("START_MISSION", "short_hop")
    wait_for(lambda: yard.pose.x > 0.5, "half a metre")
    yard.kill("navigation_controller")
    yard.twist = ZERO_TWIST  # what the drive makes of silence
    yard.launch("navigation_controller", *BLIND)
    yard.status.wait(lambda status: status.state == "COMPLETED", "the end of the ride", 40.0)
    assert_at_the_end(yard)


def test_a_killed_mission_manager_comes_back_paused_and_the_robot_stands(yard):
    yard.launch("navigation_controller", *BLIND)
    yard.launch_mission_manager()
    yard.command("START_MISSION", "short_hop")
    yard.status.wait(lambda status: status.current_waypoint == "stop", "the second waypoint")
    yard.kill("mission_manager")
    yard.launch_mission_manager()
    yard.status.wait(lambda status: status.state == "PAUSED", "PAUSED")
    plan = yard.peer.listen(topics.PLAN)
    plan.wait(lambda path: not path.poses, "navigation without a goal")
    wait_for(lambda: yard.twist.speed() < 1e-6, "standstill")
    yard.command("RESUME")
    yard.status.wait(lambda status: status.state == "COMPLETED", "the end of the ride", 40.0)
    assert_at_the_end(yard)

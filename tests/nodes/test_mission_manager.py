"""The mission manager as a process: a disk that is really full, signals, a bad parameter. See tests/simulated/nodes."""

from __future__ import annotations

import resource
import signal
from collections.abc import Callable
from pathlib import Path

from nav_msgs.msg import Odometry

from custom_msgs.msg import SafetyStatus, UICommand
from robot_stack.contract import topics
from robot_stack.core.geometry import IDENTITY
from robot_stack.middleware.conversions import pose_stamped
from tests.support.peer import Peer
from tests.support.processes import NodeProcess

Start = Callable[..., NodeProcess]


def test_a_full_disk_refuses_a_ride_and_a_signal_leaves_the_robot_without_a_goal(
    start: Start, peer: Peer, tmp_path: Path
) -> None:
    status, goals = peer.listen(topics.MISSION_STATUS), peer.listen(topics.GOAL_POSE)
    clock = peer.node.get_clock()
    peer.repeat(topics.CURRENT_POSE, lambda: pose_stamped(IDENTITY, "map", clock.now().to_msg()), 20.0)
    peer.repeat(topics.ODOM, Odometry, 50.0)
    peer.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="NORMAL"), 20.0)
    node = start("mission_manager", "-p", f"journal_file:={tmp_path / 'mission.db'}")
    status.wait(lambda message: message.state == "IDLE", "IDLE")
    # The operating system takes no page of the journal any more.
    resource.prlimit(node.pid, resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))
    begin = UICommand(command_type="START_MISSION", mission_id="short_hop")
    peer.repeat(topics.UI_COMMAND, lambda: begin, 2.0)
    status.wait(lambda message: "the journal cannot be written" in message.reason, "a refusal")
    assert goals.items == []
    resource.prlimit(node.pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    status.wait(lambda message: message.state == "RUNNING", "the ride")
    peer.silence(topics.UI_COMMAND)
    goals.wait(lambda goal: goal.header.frame_id == "map", "the first goal")
    node.signal(signal.SIGINT)
    assert node.wait() == 0
    goals.wait(lambda goal: goal.header.frame_id == "", "the goal cancelled")


def test_a_bad_parameter_is_one_line(start: Start) -> None:
    node = start("mission_manager", "-p", "tries:=0")
    assert node.wait() == 2
    errors = [line for line in node.output().splitlines() if line.startswith("error: ")]
    assert len(errors) == 1
    assert "tries" in errors[0]

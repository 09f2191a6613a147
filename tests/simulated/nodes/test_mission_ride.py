"""Mission manager and navigation controller together, on a robot without inertia."""

from __future__ import annotations

from pathlib import Path

import pytest

from custom_msgs.msg import SafetyStatus, UICommand
from robot_stack.contract import topics
from robot_stack.core.geometry import ZERO_TWIST
from tests.simulated.bench import Bench
from tests.simulated.nodes.robot import BLIND, DrivenRobot


class Yard:
    """The robot executes /cmd_vel; its pose is exact."""

    def __init__(self, bench: Bench, folder: Path) -> None:
        self.bench = bench
        self.robot = DrivenRobot(bench)
        self.status, self.plans = bench.listen(topics.MISSION_STATUS), bench.listen(topics.PLAN)
        bench.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="NORMAL"), 10.0)
        bench.publisher(topics.UI_COMMAND)
        self.navigation = bench.start("navigation_controller", BLIND)
        self.manager = bench.start("mission_manager", {"journal_file": str(folder / "mission.db")})
        bench.run(1.0)

    def command(self, name: str, mission_id: str = "") -> None:
        self.bench.publish(topics.UI_COMMAND, UICommand(command_type=name, mission_id=mission_id))
        status = self.status.wait(lambda status: status.last_command == name, f"an answer to {name}", 1.0)
        assert status.last_command_accepted, status.reason

    def begin(self) -> None:
        """Drives half a metre of the mission."""
        self.command("START_MISSION", "short_hop")
        self.bench.wait(lambda: self.robot.pose.x > 0.5, "half a metre")

    def wait_standstill(self) -> None:
        self.bench.wait(lambda: self.robot.twist.speed() < 1e-6, "standstill", 3.0)

    def completes(self) -> None:
        """Checks the arrival at the last waypoint of short_hop: (4.5, 1.5) at 45 deg."""
        done = self.status.wait(lambda status: status.state in ("COMPLETED", "FAILED"), "the end of the ride", 40.0)
        assert done.state == "COMPLETED", done.reason
        pose = self.robot.pose
        assert abs(pose.x - 4.5) <= 0.05
        assert abs(pose.y - 1.5) <= 0.05
        assert abs(pose.yaw - 0.7854) <= 0.0349


@pytest.fixture
def yard(bench: Bench, tmp_path: Path) -> Yard:
    return Yard(bench, tmp_path)


def test_a_ride_ends_at_its_last_waypoint(yard: Yard) -> None:
    yard.begin()
    yard.completes()
    assert yard.robot.driven_m < 5.2, "on the way, not around it: the route is 4.9 m long"
    etas = [status.eta_s for status in yard.status.messages if status.eta_s == status.eta_s]
    assert etas
    assert all(0.0 <= eta_s < 60.0 for eta_s in etas)
    shares = [status.progress for status in yard.status.messages if status.state in ("RUNNING", "WAITING")]
    assert shares == sorted(shares)


def test_pause_stops_and_resume_continues(yard: Yard) -> None:
    yard.begin()
    yard.command("PAUSE")
    yard.wait_standstill()
    stood = yard.robot.pose
    yard.bench.run(3.0)
    assert yard.robot.pose == stood
    yard.command("RESUME")
    yard.completes()


def test_killed_navigation_controller_receives_the_goal_again(yard: Yard) -> None:
    yard.begin()
    yard.navigation.kill()
    yard.robot.twist = ZERO_TWIST  # the drive stops without commands
    yard.bench.start_again(yard.navigation)
    yard.completes()


def test_killed_mission_manager_restarts_paused_at_standstill(yard: Yard) -> None:
    yard.begin()
    yard.status.wait(lambda status: status.current_waypoint == "stop", "the second waypoint")
    yard.manager.kill()
    yard.bench.start_again(yard.manager)
    yard.status.wait(lambda status: status.state == "PAUSED", "PAUSED")
    yard.plans.wait(lambda path: not path.poses, "navigation without a goal")
    yard.wait_standstill()
    yard.command("RESUME")
    yard.completes()

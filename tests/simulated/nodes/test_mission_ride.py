"""Mission manager and navigation controller together, on a robot without inertia."""

from __future__ import annotations

from pathlib import Path

import pytest

from custom_msgs.msg import MissionOrder, MissionWaypoint, SafetyStatus, UICommand
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract import services, topics
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


# --- an open route of the fleet --------------------------------------------------------------------------------------


def fleet(yard: Yard, operation: str, *waypoints: tuple[str, float, float], first: int = 0, more: bool = True) -> None:
    """waypoints: name, x, y; the robot passes them."""
    order = MissionOrder(id="tour_1", mission_id="tour", origin=MissionOrder.FLEET, priority=100, open=more)
    route = [MissionWaypoint(name=name, x=x, y=y, action="pass") for name, x, y in waypoints]
    code = getattr(EditMissionQueue.Request, operation)
    request = EditMissionQueue.Request(operation=code, order=order, waypoints=route, first=first)
    answer = yard.bench.call(services.EDIT_MISSION_QUEUE, request)
    assert answer.success, answer.message


def test_an_open_route_is_driven_extended_paused_and_cancelled(yard: Yard) -> None:
    released = EditMissionQueue.Request(operation=EditMissionQueue.Request.RELEASE)
    released.order.origin = MissionOrder.CLI
    assert yard.bench.call(services.EDIT_MISSION_QUEUE, released).success
    fleet(yard, "ADD", ("a", 1.5, 0.0))
    yard.bench.wait(lambda: yard.robot.pose.x > 0.5, "half a metre", 30.0)
    fleet(yard, "EXTEND", ("b", 3.0, 0.0), first=1)
    slowest_mps = 9.0
    while yard.robot.pose.x < 2.0:
        yard.bench.run(0.1)
        slowest_mps = min(slowest_mps, yard.robot.twist.speed())
    assert slowest_mps > 0.3, "it passes the waypoint that was the last one"

    waits = yard.status.wait(lambda status: status.state == "WAITING", "the wait for the next part", 20.0)
    assert "next part of the route" in waits.reason
    assert abs(yard.robot.pose.x - 3.0) <= 0.05, "it comes to rest at a waypoint to pass"
    yard.bench.run(15.0)
    yard.wait_standstill()
    fleet(yard, "EXTEND", ("c", 8.0, 0.0), first=2)
    yard.bench.wait(lambda: yard.robot.pose.x > 3.4, "on the way to the next part", 10.0)

    fleet(yard, "PAUSE")
    yard.wait_standstill()
    at = yard.robot.pose
    yard.bench.run(5.0)
    assert yard.robot.pose == at
    fleet(yard, "RESUME")
    yard.bench.wait(lambda: yard.robot.pose.x > at.x + 0.3, "on the way again", 10.0)
    fleet(yard, "CANCEL")
    yard.wait_standstill()
    assert yard.status.last.state == "ABORTED"
    assert yard.robot.pose.x < 7.5

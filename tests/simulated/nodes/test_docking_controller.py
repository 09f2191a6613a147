"""The docking controller on a motion engine; a peer replaces the rest of a standing robot."""

from __future__ import annotations

from typing import Any

import pytest
from nav_msgs.msg import Odometry
from std_msgs.msg import Bool

from custom_msgs.action import Dock, Undock
from custom_msgs.msg import ArucoDetectionArray, SafetyStatus
from robot_stack.contract import actions, topics
from robot_stack.core.robot import load_robot
from robot_stack.docking.nodes.attached_file import AttachedFile
from tests.simulated.bench import COMPUTE_S, LATENCY_S, Bench
from tests.simulated.nodes.navigation import FakeNavigation
from tests.simulated.story import Goal

OPEN = 1 << load_robot().latch.open_input_bit
CLOSED = 1 << load_robot().latch.closed_input_bit


class Scene:
    """The node. The peer publishes odometry, safety and empty images; the latch is open."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.status, self.command = bench.listen(topics.DOCKING_STATUS), bench.listen(topics.DOCKING_CMD_VEL)
        self.passenger = bench.listen(topics.PASSENGER_ATTACHED)
        bench.publisher(topics.EMERGENCY_STOP)
        self.navigation = FakeNavigation(bench)
        bench.engine.run().up()
        bench.engine.drives.inputs = {0: 1 | OPEN}
        safety = SafetyStatus(safety_state=SafetyStatus.NORMAL)
        for row, make in (
            (topics.ODOM, self._odometry),
            (topics.SAFETY_STATUS, lambda: safety),
            (topics.ARUCO_DETECTIONS, self._images),
        ):
            bench.repeat(row, make, row.rate_hz or 10.0)
        self.process = bench.start("docking_controller")
        self.passenger.wait()

    def _odometry(self) -> Odometry:
        message = Odometry()
        message.header.stamp = self.bench.stamp()
        message.pose.pose.orientation.w = 1.0
        return message

    def _images(self) -> ArucoDetectionArray:
        message = ArucoDetectionArray()
        message.header.stamp = self.bench.stamp()
        return message

    def dock(self, dock_id: str = "chair_1") -> Goal:
        return self.bench.begin(actions.DOCK, Dock.Goal(dock_id=dock_id))

    def undock(self) -> Goal:
        return self.bench.begin(actions.UNDOCK, Undock.Goal())

    def staging(self, count: int = 1) -> Any:
        """Waits until navigation has received so many goals; returns the last."""
        self.bench.wait(lambda: len(self.navigation.goals) == count, f"goal {count}")
        return self.navigation.goals[-1][1]

    def wait_state(self, state: str) -> Any:
        return self.status.wait(lambda message: message.state == state, state)


@pytest.fixture
def scene(bench: Bench) -> Scene:
    return Scene(bench)


def test_invalid_goals_are_refused_with_a_reason_without_motion(scene: Scene) -> None:
    assert scene.passenger.last.data is False
    unknown = scene.dock("nowhere").wait()
    assert (unknown.success, unknown.error_code) == (False, Dock.Result.UNKNOWN_DOCK)
    assert "chair_1" in unknown.reason
    nothing = scene.undock().wait()
    assert (nothing.success, nothing.error_code) == (False, Undock.Result.NOT_ATTACHED)
    first = scene.dock()
    assert scene.dock().wait().error_code == Dock.Result.BUSY
    assert first.cancel().error_code == Dock.Result.CANCELED
    scene.wait_state("IDLE")
    assert all(item.twist.linear.x == 0.0 and item.twist.angular.z == 0.0 for item in scene.command.messages)


def test_docking_sends_the_staging_pose_and_ends_on_an_emergency_stop(scene: Scene) -> None:
    goal = scene.dock()
    scene.wait_state("APPROACH")
    staging = scene.staging()
    assert staging.header.frame_id == "map"
    assert (staging.pose.position.x, staging.pose.position.y) == pytest.approx((-2.05, 11.0))
    stopped_s = scene.bench.now_s
    scene.bench.publish(topics.EMERGENCY_STOP, Bool(data=True))
    result = goal.wait()
    assert (result.error_code, result.reason) == (Dock.Result.SAFETY_STOP, "emergency stop")
    # Detection by a tick of 20 Hz, plus the transport of the result.
    assert scene.bench.now_s - stopped_s < 0.05 + 2.0 * COMPUTE_S + 3.0 * LATENCY_S + 0.005
    scene.wait_state("FAILED")
    assert {message.state for message in scene.status.since(stopped_s)} <= {"APPROACH", "FAILED"}
    scene.bench.wait(lambda: scene.navigation.ended == ["canceled"], "the end of the goal", 1.0)


def test_a_cancelled_docking_cancels_its_goal_and_the_next_one_sends_another(scene: Scene) -> None:
    goal = scene.dock()
    scene.staging()
    assert goal.cancel().error_code == Dock.Result.CANCELED
    scene.bench.wait(lambda: scene.navigation.ended == ["canceled"], "the end of the goal", 1.0)
    scene.dock()
    scene.staging(2)
    scene.bench.run(5.0)
    assert len(scene.navigation.goals) == 2


def test_a_preempted_goal_is_sent_again_and_one_of_a_restarted_navigation_at_once(scene: Scene) -> None:
    scene.dock()
    scene.staging()
    preempted_s = scene.bench.now_s
    scene.navigation.end()
    scene.staging(2)
    assert 2.0 <= scene.bench.now_s - preempted_s <= 2.1
    scene.navigation.process.kill()
    scene.bench.run(0.5)
    scene.bench.start_again(scene.navigation.process)
    scene.staging(3)
    assert scene.status.last.state == "APPROACH"


def test_a_stopped_process_cancels_its_goal(scene: Scene) -> None:
    scene.dock()
    scene.staging()
    assert scene.bench.stop(scene.process) == 0
    scene.bench.wait(lambda: scene.navigation.ended == ["canceled"], "the end of the goal", 1.0)


def test_status_has_its_rate_and_the_process_shuts_down_cleanly(scene: Scene) -> None:
    scene.bench.run(3.0)
    assert scene.status.period_s() == pytest.approx(0.1, abs=1e-6)
    assert scene.command.items == []
    assert scene.bench.stop(scene.process) == 0


def test_a_latch_that_cannot_be_read_keeps_its_last_known_state(scene: Scene) -> None:
    """Perception would take the person before the passenger's knees for a part of the released chair."""
    latch = scene.bench.listen(topics.LATCH_STATUS)
    scene.bench.engine.drives.inputs = {0: 1 | CLOSED}
    latch.wait(lambda message: message.closed, "the closed latch")
    lost_s = scene.bench.now_s
    scene.bench.engine.drives.connected = False
    scene.bench.run(0.5)
    scene.bench.engine.recover()
    scene.bench.run(0.5)
    stated = latch.since(lost_s)
    assert len(stated) >= 9
    assert all(message.closed and message.attached for message in stated)


def test_a_chair_that_came_loose_while_the_controller_was_dead_is_an_emergency_with_the_passenger_aboard(
    scene: Scene,
) -> None:
    stops, sources = scene.bench.listen(topics.EMERGENCY_STOP), scene.bench.listen(topics.EMERGENCY_STOP_SOURCES)
    scene.process.kill()
    assert AttachedFile().save(True) == ""  # the state after carrying a passenger
    scene.bench.run(1.0)
    begun_s = scene.bench.now_s
    scene.bench.start_again(scene.process)
    stops.wait(lambda message: message.data, "the emergency stop")
    sources.wait(lambda message: message.name == "docking_controller" and message.pressed, "its author")
    scene.wait_state("FAILED")
    aboard = [message.data for message in scene.passenger.since(begun_s)]
    assert aboard
    assert all(aboard)


def test_a_controller_that_is_restarted_at_a_charger_is_docked_and_undocks(scene: Scene) -> None:
    scene.process.kill()
    assert AttachedFile().save(False, "charger") == ""  # the state after docking to the charger
    scene.bench.run(1.0)
    scene.bench.start_again(scene.process)
    scene.wait_state("DOCKED")
    assert scene.passenger.last.data is False
    scene.undock()
    out = scene.command.wait(lambda message: message.twist.linear.x != 0.0, "the way out", 10.0)
    assert out.twist.linear.x > 0.0

"""The mission manager with a fake docking controller that succeeds, fails, hangs or dies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from std_msgs.msg import Bool

from custom_msgs.action import Dock
from robot_stack.contract import topics
from robot_stack.core.geometry import Pose2
from robot_stack.mission.journal import SqliteJournal
from robot_stack.mission.states import State
from tests.simulated.bench import Bench
from tests.simulated.nodes.docking import FakeDocking
from tests.simulated.nodes.test_mission_manager import World

TRANSPORT = """
id: transport
name: {en: Transport, ja: 搬送, zh: 接送}
home: {x: 0.0, y: 0.0, yaw: 0.0}
waypoints:
  - {name: chair, x: 2.0, y: 0.0, yaw: 0.0, action: {dock: chair_1}}
  - {name: there, x: 4.0, y: 0.0, yaw: 0.0, action: undock}
  - {name: bay, x: 6.0, y: 0.0, yaw: 0.0, action: park}
"""


class DockWorld(World):
    def __init__(self, bench: Bench, folder: Path) -> None:
        super().__init__(bench, folder)
        (self.missions / "transport.yaml").write_text(TRANSPORT, encoding="utf-8")

    def serve(self) -> FakeDocking:
        self.docking = FakeDocking(self.bench)
        return self.docking

    def begin(self) -> None:
        """Starts the mission and puts the robot at the chair."""
        assert self.command("START_MISSION", "transport").last_command_accepted, self.status.last.reason
        self.goal(2.0)
        self.pose = Pose2(2.0, 0.0, 0.0)
        self.begun_s = self.bench.now_s

    def reason(self, text: str) -> Any:
        return self.status.wait(lambda s: text in s.reason, f"{text!r} in the reason")

    def fails(self, reason: str, after_s: float) -> Any:
        """Waits for the failure. after_s: since the robot is at the chair, which the next tick detects."""
        failed = self.state("FAILED")
        assert failed.reason == reason
        assert after_s <= self.bench.now_s - self.begun_s <= after_s + 0.7
        return failed

    def cancelled(self) -> None:
        self.bench.wait(lambda: self.docking.cancelled, "the goal cancelled", 1.0)


@pytest.fixture
def world(bench: Bench, tmp_path: Path) -> DockWorld:
    return DockWorld(bench, tmp_path)


def test_the_wheelchair_is_fetched_carried_and_put_down(world):
    docking = world.serve()
    docking.step_s = 1.0
    world.launch()
    world.begin()
    world.reason("docking to chair_1: SERVOING")
    world.state("RUNNING", "there")
    assert world.status.last.passenger_attached
    world.goal(4.0)
    world.pose = Pose2(4.0, 0.0, 0.0)
    world.state("RUNNING", "bay")
    world.pose = Pose2(6.0, 0.0, 0.0)
    done = world.state("COMPLETED")
    assert (done.waypoints_completed, done.passenger_attached) == (3, False)
    assert docking.goals == [("dock", "chair_1"), ("undock", "chair_1")]
    assert {message.state_num for message in world.display.messages} >= {21, 22, 23, 26, 27, 1}


def test_failure_ends_the_mission_with_its_code_and_reason(world):
    docking = world.serve()
    docking.error = (Dock.Result.MARKERS_NOT_FOUND, "no marker in sight")
    world.launch()
    world.begin()
    failed = world.state("FAILED")
    assert failed.reason == "docking to chair_1 failed: no marker in sight (MARKERS_NOT_FOUND)"
    world.display.wait(lambda message: message.state_num == 28, "docking failed on the display")
    assert docking.goals == [("dock", "chair_1")]


def test_a_rejected_goal_ends_the_mission(world):
    world.serve().rejects = True
    world.launch()
    world.begin()
    assert world.state("FAILED").reason == "docking to chair_1 failed: the goal was rejected"


def test_goal_with_a_lost_answer_is_tracked_by_its_status(world):
    docking = world.serve()
    docking.loses_answers, docking.step_s = True, 1.0
    world.launch()
    world.begin()
    world.reason("docking to chair_1: SERVOING")
    world.state("RUNNING", "there")


def test_docking_goal_with_lost_answer_is_cancelled(world):
    docking = world.serve()
    docking.hangs, docking.loses_answers, docking.steps = True, True, ()
    world.launch(docking_wait_s=1.5)
    world.begin()
    world.fails("docking to chair_1 failed: docking_controller has not answered for 2 s", 1.5)
    world.cancelled()


def test_after_a_goal_that_was_lost_the_next_one_is_sent(world):
    docking = world.serve()
    docking.loses_goals = True
    world.launch(docking_wait_s=3.0)
    world.begin()
    world.fails("docking to chair_1 failed: docking_controller has not answered for 3 s", 3.0)
    docking.loses_goals = False
    world.begin()
    world.state("RUNNING", "there")
    assert docking.goals == [("dock", "chair_1")]


def test_an_emergency_stop_cancels_and_resume_docks_again_after_a_slow_end(world):
    docking = world.serve()
    docking.hangs, docking.cancel_s = True, 1.0
    world.launch()
    world.begin()
    world.reason("docking to chair_1: FINE_ALIGN")
    assert world.command("EMERGENCY_STOP").state == "PAUSED"
    world.cancelled()
    world.safety_says("EMERGENCY_STOP", "ESTOP_PRESSED")
    assert not world.command("RESUME").last_command_accepted
    world.bench.publish(topics.EMERGENCY_STOP, Bool(data=False))
    world.safety_says("NORMAL")
    docking.hangs = False
    assert world.command("RESUME").last_command_accepted
    world.state("RUNNING", "there")
    assert docking.goals == [("dock", "chair_1"), ("dock", "chair_1")]


def test_a_docking_controller_that_is_killed(world):
    docking = world.serve()
    docking.hangs = True
    world.launch()
    world.begin()
    world.reason("docking to chair_1: FINE_ALIGN")
    killed_s = world.bench.now_s
    docking.process.kill()
    # DDS keeps its endpoints for the lease of 2 s.
    assert world.state("FAILED").reason == "docking to chair_1 failed: docking_controller is not available"
    assert 2.0 <= world.bench.now_s - killed_s <= 2.3


def test_mission_manager_killed_while_docking_restarts_paused_and_cancels_the_goal(world):
    docking = world.serve()
    docking.hangs = True
    world.launch()
    world.begin()
    world.reason("docking to chair_1: FINE_ALIGN")
    world.kill()
    assert SqliteJournal(world.journal).load().state is State.DOCKING
    world.launch()
    status = world.status.wait(lambda s: s.state == "PAUSED", "PAUSED")
    assert status.reason.startswith("restarted while DOCKING at 'chair'")
    world.cancelled()  # the goal of the killed mission manager
    docking.hangs = False
    world.bench.run(5.0)
    assert len(docking.goals) == 1, "nothing begins by itself"
    assert world.command("RESUME").last_command_accepted
    world.state("RUNNING", "there")
    assert docking.goals == [("dock", "chair_1"), ("dock", "chair_1")]


def test_its_end_cancels_the_docking(world):
    docking = world.serve()
    docking.hangs = True
    node = world.launch()
    world.begin()
    world.reason("docking to chair_1: FINE_ALIGN")
    assert world.bench.stop(node) == 0
    world.cancelled()

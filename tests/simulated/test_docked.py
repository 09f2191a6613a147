"""With the wheelchair on the latch: the docking controller is killed, in a mission too, and the latch opens.

A mission that has failed waits for a person. After the latch has opened only an undocking may move the robot.
"""

from __future__ import annotations

import math
from typing import Any

import pytest

from custom_msgs.msg import MissionQueue
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract import services, topics
from robot_stack.core.geometry import Pose2
from robot_stack.core.runtime import own_missions_dir
from robot_stack.middleware.conversions import pose_from_msg
from tests.simulated.shared import shared
from tests.simulated.stage import DOCK, Stage, docked, staged_before_chair

START = Pose2(0.2, 0.3, math.radians(10.0))
_RELEASE = EditMissionQueue.Request(operation=EditMissionQueue.Request.RELEASE)


def write_mission(action: str, pose: Pose2) -> None:
    """The mission ``short`` of one waypoint, among those made on the robot of the present run."""
    text = f"""
id: short
name: {{en: Short, ja: 走行, zh: 行驶}}
home: {{x: 0.0, y: 0.0, yaw: 0.0}}
waypoints:
  - {{name: end, x: {pose.x}, y: {pose.y}, yaw: {pose.yaw}, action: {action}}}
"""
    own_missions_dir().mkdir(parents=True, exist_ok=True)
    (own_missions_dir() / "short.yaml").write_text(text, encoding="utf-8")


def begin(stage: Stage) -> None:
    assert stage.call(services.EDIT_MISSION_QUEUE, _RELEASE).success
    stage.command("START_MISSION", "short")


def kill_and_wait_failed(stage: Stage) -> Any:
    """Kills the controller, waits for the failed mission, and checks that nothing goes on without a person."""
    queue = stage.listen(topics.MISSION_QUEUE)
    stage.kill("docking_controller")
    failed = stage.wait_mission("FAILED", 5.0)
    assert "docking_controller" in failed.reason
    queue.wait(lambda message: message.held_by == MissionQueue.MISSION_FAILED, "the held queue", 1.0)
    stage.wait_stands(2.0)
    stage.wait_restarted("docking_controller")
    stage.assert_wheels_rest(3.0)
    assert stage.mission.last.state == "FAILED"
    return failed


def test_a_mission_whose_docking_controller_dies_fails_and_may_be_started_again() -> None:
    with staged_before_chair(START) as stage:
        write_mission(f"{{dock: {DOCK}}}", stage.dock.staging.pose())
        stage.assert_wheels_rest(0.3)  # until the mission manager has the pose and safety state, too
        begin(stage)
        stage.wait_docking("SERVOING", 60.0)
        stage.wait_faster(0.08)
        assert not kill_and_wait_failed(stage).passenger_attached
        stage.command("START_MISSION", "short")
        stage.wait_docking("SERVOING", 60.0)


def begin_undocking(stage: Stage) -> None:
    """The mission undocks where the robot stands."""
    write_mission("undock", pose_from_msg(stage.pose.last.pose))
    begin(stage)


@shared(docked, START)
def test_a_mission_whose_docking_controller_dies_before_it_unlatches_keeps_the_chair() -> None:
    with docked(START) as stage:
        begin_undocking(stage)
        stage.mission.wait(lambda message: "undocking" in message.reason, "the undocking", 30.0)
        assert kill_and_wait_failed(stage).passenger_attached
        assert stage.docking.last.state == "DOCKED"
        assert stage.passenger.last.data is True
        stage.command("START_MISSION", "short")
        stage.wait_docking("SERVOING", 30.0)


@shared(docked, START)
def test_a_docking_controller_that_dies_with_an_open_latch_stops_the_robot() -> None:
    """After the restart, an open latch may have opened by itself: the passenger counts as aboard."""
    with docked(START) as stage:
        begin_undocking(stage)
        stage.wait_docking("SERVOING", 30.0)
        stage.wait_faster(0.08)
        stage.kill("docking_controller")
        stage.wait_safety("EMERGENCY_STOP", "LATCH_NOT_CLOSED")
        assert stage.wait_mission("PAUSED").passenger_attached
        stage.wait_stands(2.0)
        stage.wait_restarted("docking_controller")
        stage.assert_wheels_rest(2.0)
        stage.release()
        stage.assert_wheels_rest(2.0)
        stage.command("RESUME")
        stage.wait_mission("COMPLETED", 40.0)
        assert stage.passenger.last.data is False


@shared(docked, START)
def test_killed_controller_keeps_the_wheelchair_after_restart() -> None:
    with docked(START) as stage:
        assert stage.passenger.last.data is True
        position_m, yaw_rad = stage.docking_error()
        assert position_m < 0.0005  # the closed latch holds the robot at the dock pose
        assert yaw_rad < math.radians(0.1)
        stage.kill("docking_controller")
        stage.wait_restarted("docking_controller")
        stage.wait_docking("DOCKED", 10.0)
        stage.run(0.5)
        assert stage.passenger.last.data is True
        before = stage.at()
        result = stage.begin_undocking().wait(30.0)
        assert result.success, result.reason
        stage.run(0.2)
        assert stage.passenger.last.data is False
        assert stage.at().distance_to(before) == pytest.approx(0.5, abs=0.03)


@shared(docked, START)
def test_a_loose_chair_is_left_by_undocking_only() -> None:
    with docked(START) as stage:
        stage.drive(-0.4)
        stage.wait_faster(0.35)
        stage.inject("latch_opens")
        stage.wait_safety("EMERGENCY_STOP", "CHAIR_LOOSE")
        stage.wait_stands(5.0)
        stage.drive(0.0)
        stage.release()
        stage.wait_safety("DEGRADED", "LATCH_NOT_CLOSED")
        stage.run(0.5)
        stage.drive(1.0)
        stage.assert_wheels_rest(3.0)
        assert stage.limit.last.max_linear_velocity == 0.0
        assert stage.passenger.last.data is True
        stage.let_go()
        before = stage.at()
        goal = stage.begin_undocking()
        fastest_mps = 0.0
        while goal.result is None:
            stage.run(0.05)
            fastest_mps = max(fastest_mps, stage.speed_mps)
        assert goal.result.success, goal.result.reason
        assert 0.05 < fastest_mps < 0.16
        assert stage.at().distance_to(before) > 0.45
        stage.run(0.5)
        assert stage.passenger.last.data is False
        assert "EMERGENCY_STOP" not in stage.safety_states(stage.now_s - 1.0)
        stage.wait_safety("NORMAL")

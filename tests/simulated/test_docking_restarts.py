"""The docking controller is killed while a mission docks or undocks: the mission fails and waits for a person."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from custom_msgs.msg import MissionQueue
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract import services, topics
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Pose2
from robot_stack.middleware.conversions import pose_from_msg
from tests.simulated.stage import DOCK, Stage, docked, staged_before_chair
from tests.support.environment import own_config

START = Pose2(0.2, 0.3, math.radians(10.0))
_RELEASE = EditMissionQueue.Request(operation=EditMissionQueue.Request.RELEASE)


def mission(action: str, pose: Pose2) -> str:
    """The mission ``short`` of one waypoint."""
    return f"""
id: short
name: {{en: Short, ja: 走行, zh: 行驶}}
home: {{x: 0.0, y: 0.0, yaw: 0.0}}
waypoints:
  - {{name: end, x: {pose.x}, y: {pose.y}, yaw: {pose.yaw}, action: {action}}}
"""


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
    stage.assert_wheels_rest(5.0)
    assert stage.mission.last.state == "FAILED"
    return failed


def test_a_mission_whose_docking_controller_dies_fails_and_may_be_started_again(tmp_path: Path) -> None:
    staging = load_docks().docks[DOCK].staging.pose()
    with own_config(tmp_path, short=mission(f"{{dock: {DOCK}}}", staging)), staged_before_chair(START) as stage:
        stage.assert_wheels_rest(0.3)  # until the mission manager has the pose and safety state, too
        begin(stage)
        stage.wait_docking("SERVOING", 60.0)
        stage.wait_faster(0.08)
        assert not kill_and_wait_failed(stage).passenger_attached
        stage.command("START_MISSION", "short")
        stage.wait_docking("SERVOING", 60.0)


def begin_undocking(stage: Stage, config: Path) -> None:
    """The mission undocks where the robot stands."""
    here = pose_from_msg(stage.pose.last.pose)
    (config / "missions" / "short.yaml").write_text(mission("undock", here), encoding="utf-8")
    begin(stage)


def test_a_mission_whose_docking_controller_dies_before_it_unlatches_keeps_the_chair(tmp_path: Path) -> None:
    with own_config(tmp_path) as config, docked(START) as stage:
        begin_undocking(stage, config)
        stage.mission.wait(lambda message: "undocking" in message.reason, "the undocking", 30.0)
        assert kill_and_wait_failed(stage).passenger_attached
        assert stage.docking.last.state == "DOCKED"
        assert stage.passenger.last.data is True
        stage.command("START_MISSION", "short")
        stage.wait_docking("SERVOING", 30.0)


def test_a_docking_controller_that_dies_with_an_open_latch_stops_the_robot(tmp_path: Path) -> None:
    """After the restart, an open latch may have opened by itself: the passenger counts as aboard."""
    with own_config(tmp_path) as config, docked(START) as stage:
        begin_undocking(stage, config)
        stage.wait_docking("SERVOING", 30.0)
        stage.wait_faster(0.08)
        stage.kill("docking_controller")
        stage.wait_safety("EMERGENCY_STOP", "LATCH_NOT_CLOSED")
        assert stage.wait_mission("PAUSED").passenger_attached
        stage.wait_stands(2.0)
        stage.wait_restarted("docking_controller")
        stage.assert_wheels_rest(3.0)
        stage.release()
        stage.assert_wheels_rest(3.0)
        stage.command("RESUME")
        stage.wait_mission("COMPLETED", 40.0)
        assert stage.passenger.last.data is False

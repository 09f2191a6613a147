"""Docking on the whole robot in physics: cameras, detector, controller, latch, and faults.

tests/unit/docking tests the reaction of every state to every fault, tests/unit/sim the faults of latch and charger.
"""

from __future__ import annotations

import math
from pathlib import Path

from robot_stack.contract import services
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Pose2
from sim.settings import pose_settings
from tests.simulated.stage import staged, staged_before_chair
from tests.support.environment import own_config

START = Pose2(0.2, 0.3, math.radians(10.0))


def test_a_dead_camera_and_an_emergency_stop_while_servoing_end_the_docking() -> None:
    with staged_before_chair(START) as stage:
        goal = stage.begin_docking()
        stage.wait_docking("SERVOING")
        stage.inject("silent", "front", into=services.INJECT_CAMERA_FAULT)
        result = goal.wait(10.0)
        assert (result.success, result.error_code) == (False, result.CAMERA_TIMEOUT)
        stage.wait_safety("DEGRADED", "CAMERA_TIMEOUT", 1.0)
        stage.wait_stands(3.0)
        stage.wait_docking("FAILED", 2.0)
        stage.inject("clear", into=services.INJECT_CAMERA_FAULT)

        goal = stage.begin_docking()
        stage.wait_docking("SERVOING")
        stage.wait_faster(0.08)
        stage.estop(True)
        stage.wait_stands(3.0)
        result = goal.wait(2.0)
        assert (result.success, result.error_code) == (False, result.SAFETY_STOP)
        assert result.reason == "emergency stop"
        stage.wait_docking("FAILED", 2.0)
        stage.release()
        before = stage.at()
        stage.assert_wheels_rest(1.0)
        assert stage.at().distance_to(before) < 0.002  # after the release it does not continue by itself


def test_a_marker_covered_is_passed_over_and_a_chair_moved_is_docked_to_again() -> None:
    with staged_before_chair(START, "docking_controller.tries=2") as stage:
        goal = stage.begin_docking()
        stage.wait_docking("SERVOING")
        stage.inject("cover", "0", duration_s=1.0, into=services.INJECT_CAMERA_FAULT)
        stage.docking.wait(lambda message: message.visible_markers_count == 3, "three markers")
        stage.docking.wait(lambda message: message.visible_markers_count == 4, "four markers again", 20.0)
        stage.wait_docking("FINE_ALIGN")
        before = stage.at()
        stage.inject("chair_moved", "0.0,0.2,0.0")
        stage.wait_docking("APPROACH", 5.0)
        assert stage.at().distance_to(before) < 0.05  # it stops as soon as the markers show the offset
        stage.wait_docking("SERVOING")
        assert goal.result is None


# Where the robot's rear right corner would be at the staging pose of chair_1.
BOX = "boxes: [{name: box, x_m: -1.5, y_m: 11.35, length_m: 0.3, width_m: 0.3, height_m: 0.6}]"
CHAIR = "    kind: wheelchair\n"
OTHER_STAGING = "    staging_alternatives: [{along_m: 1.3, across_m: 0.4}]\n"


def test_an_obstacle_at_the_staging_pose_leads_to_another_one(tmp_path: Path) -> None:
    with own_config(tmp_path) as config:
        docks, flat = config / "docks.yaml", config / "worlds" / "flat.yaml"
        docks.write_text(docks.read_text().replace(CHAIR, CHAIR + OTHER_STAGING))
        (config / "worlds" / "blocked.yaml").write_text(f"{flat.read_text()}{BOX}\n")
        row = load_docks().docks["chair_1"]
        staging = row.staging.pose()
        chair = staging.compose(Pose2(1.5, 0.0, 0.0)).compose(row.dock_pose.pose().inverse())
        at_chair = pose_settings("sim_world.wheelchair", chair)
        start = staging.compose(Pose2(-1.2, 0.9, 0.0))
        with staged("blocked", *at_chair, "docking_controller.tries=1", start=start) as stage:
            goal = stage.begin_docking()
            stage.docking.wait(lambda message: message.state == "SEARCH", "a staging pose", 120.0)
            assert stage.at().distance_to(row.stagings[1].pose()) < 0.15
            assert goal.result is None, "still the first try"

"""A mission fetches a wheelchair, carries it to its destination and puts it down."""

from __future__ import annotations

import math
from pathlib import Path

from robot_stack.core.geometry import Pose2
from tests.simulated.stage import staged_before_chair
from tests.support.environment import own_config

# Beside the staging pose, where the localization starts: without a map this error remains.
START = Pose2(0.2, 0.3, math.radians(10.0))
DESTINATION = Pose2(2.0, 11.0, math.pi)
MISSION = """
id: carry
name: {en: Carry, ja: 搬送, zh: 接送}
home: {x: 3.5, y: 11.0, yaw: 3.1416}
waypoints:
  - {name: pick-up, x: -2.05, y: 11.0, yaw: 3.1416, action: {dock: chair_1}}
  - {name: back out, x: 0.0, y: 11.0, yaw: 3.1416, action: pass}
  - {name: destination, x: 2.0, y: 11.0, yaw: 3.1416, action: undock}
  - {name: bay, x: 3.5, y: 11.0, yaw: 3.1416, action: park}
"""


def test_a_wheelchair_is_fetched_carried_and_put_down(tmp_path: Path) -> None:
    with own_config(tmp_path, carry=MISSION), staged_before_chair(START) as stage:
        begun_s = stage.now_s
        stage.command("START_MISSION", "carry")
        stage.passenger.wait(lambda message: message.data, "the wheelchair on the latch", 90.0)
        assert stage.world.sim.world.attached
        stage.mission.wait(lambda message: message.current_waypoint == "destination", "the way to it", 60.0)
        assert stage.passenger.last.data
        assert stage.limit.last.max_linear_velocity <= 1.0
        stage.passenger.wait(lambda message: not message.data, "the wheelchair put down", 60.0)
        stage.wait_mission("COMPLETED", 60.0)
        stage.wait_stands()
        chair, dock = stage.wheelchair(), stage.dock
        staging = dock.staging.pose()
        believed = DESTINATION.compose(dock.dock_pose.pose().inverse())
        expected = staging.compose(START).compose(staging.inverse()).compose(believed)
        assert chair.distance_to(expected) < 0.10  # navigation's tolerance and the wheel odometry's drift
        assert stage.at().distance_to(chair) > 2.0
        assert "EMERGENCY_STOP" not in stage.safety_states(begun_s)

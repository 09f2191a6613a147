"""The whole robot in a lift of the simulated building, from the ground floor of the hospital to the first."""

from __future__ import annotations

import math

from custom_msgs.msg import BuildingRequest
from robot_stack.contract import topics
from robot_stack.core.geometry import Pose2
from robot_stack.core.levels import load_levels
from tests.simulated.stage import staged

_START, _GOAL = Pose2(-1.0, 0.3, math.pi / 2), Pose2(-1.0, 40.2, math.pi / 2)


def test_the_robot_rides_by_the_lift_to_the_first_floor() -> None:
    levels = load_levels("hospital")
    with staged("hospital", start=_START) as stage:
        requests = stage.listen(topics.BUILDING_REQUEST)
        stage.go(_GOAL)
        stage.wait(lambda: levels.level_at(stage.at()) == "first", "the robot on the first floor", 90.0)
        assert stage.stands
        stage.wait(lambda: stage.at().distance_to(_GOAL) < 0.05 and stage.stands, "the goal", 60.0)
        assert stage.estimate_error_m() < 0.1
        stage.run(0.5)
        assert (requests.last.name, requests.last.mode) == ("lift_1", BuildingRequest.CLOSED)
        assert BuildingRequest.ASKING_STAFF not in {message.phase for message in requests.since(0.0)}

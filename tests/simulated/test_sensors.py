"""A failed LiDAR, a displaced robot, an occupied goal: the whole robot on the site with its map."""

from __future__ import annotations

import math

import pytest

from robot_stack.contract import services
from robot_stack.core.geometry import Pose2
from tests.simulated.shared import shared
from tests.simulated.stage import staged

START = Pose2(2.0, 0.0, 0.0)  # along the south route


def test_a_start_that_is_wrong_by_a_metre_is_corrected() -> None:
    with staged("yard", start=START, wrong_by=Pose2(0.8, -0.6, math.radians(10.0))) as stage:
        stage.wait(lambda: stage.estimate_error_m() < 0.05, "the pose by the map", 20.0)
        assert stage.quality.last.data > 0.5


def test_the_robot_stops_before_a_wall_at_which_it_is_driven() -> None:
    with staged("yard", start=Pose2(0.0, 2.0, math.pi)) as stage:  # the depot's wall is at x = -3.5
        stage.drive(0.8)
        stage.wait_safety("COLLISION_AVOIDANCE", "OBSTACLE_NEAR")
        stage.wait_safety("COLLISION_AVOIDANCE", "COLLISION_IMMINENT")
        stage.wait_stands(6.0)
        stage.let_go()
        gap_m = stage.at().x - 0.5 + 3.5
        assert 0.10 < gap_m < 0.6
        stage.drive(-0.4)
        stage.wait_faster(0.3)  # the way back is free


@shared(staged, "yard", start=START)
@pytest.mark.parametrize(("kind", "value"), [("frozen", 0.0), ("covered", 1.0)])
def test_a_lidar_that_does_not_see_stops_the_robot(kind: str, value: float) -> None:
    """A silent one: test_losing_sight.py."""
    with staged("yard", start=START) as stage:
        stage.drive_at(0.6)
        stage.inject(kind, value=value, into=services.INJECT_LIDAR_FAULT)
        stage.wait_safety("DEGRADED", "LIDAR_TIMEOUT")
        stage.wait_stands(5.0)
        assert "OBSTACLES_TIMEOUT" in stage.safety.last.active_faults
        stage.let_go()
        stage.inject("clear", into=services.INJECT_LIDAR_FAULT)
        stage.wait_safety("NORMAL", limit_s=30.0)


@shared(staged, "yard", start=START)
def test_a_robot_that_is_carried_off_stops_and_localises_itself() -> None:
    with staged("yard", start=START) as stage:
        stage.drive_at(0.4)
        stage.inject("robot_moved", "12,3,60")
        stage.wait_safety("DEGRADED", "LOCALIZATION_LOST", limit_s=30.0)
        stage.wait_stands(5.0)
        stage.let_go()
        stage.wait_safety("NORMAL", limit_s=60.0)
        assert stage.estimate_error_m() < 0.10


def test_a_place_that_is_taken_is_not_driven_into() -> None:
    """The goal is at the wheelchair, which is not in the map."""
    with staged("yard", start=Pose2(0.0, 11.0, math.pi)) as stage:
        chair = stage.wheelchair()
        stage.go(Pose2(chair.x, chair.y, math.pi))
        stage.navigation.wait(lambda message: message.data.startswith("gave up"), "navigation gives up", 90.0)
        stage.wait_stands()
        stage.run(0.1)  # the status may arrive before the plan
        assert len(stage.plan.last.poses) == 0
        assert stage.at().distance_to(chair) > 0.9

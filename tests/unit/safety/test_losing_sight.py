"""With stale clouds the robot brakes hard, judged by the last obstacles. An assumed chair hides no obstacle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_stack.contract import topics
from robot_stack.contract.model import SafetyState
from robot_stack.core.geometry import Twist2
from robot_stack.safety.chair_watch import LatchStatement
from tests.unit.safety.story import CLOSED, NOTHING, PARAMS, ROBOT, TICK_S, Story

NORMAL, DEGRADED, AVOIDANCE, EMERGENCY = SafetyState
STALE_S = topics.OBSTACLES.stale_limit_s
SIGHT_STALE_S = PARAMS.obstacles.sight_stale_s
BUMPER_M = ROBOT.footprint.front_m
RIDE = Twist2(1.0, 0.0, 0.0)


def things(x_m: float) -> NDArray[np.float32]:
    """A person 0.4 m wide."""
    return np.array([(x_m, y, z) for y in (-0.2, -0.1, 0.0, 0.1, 0.2) for z in (0.3, 1.0)], np.float32)


def riding() -> Story:
    story = Story().healthy()
    story.driven = story.request = RIDE
    story.wheel_radps = RIDE.vx / ROBOT.wheel_radius_m
    return story


@pytest.mark.parametrize(("sensor", "row"), [("sweep", "LIDAR_TIMEOUT"), ("overhead", "LIDAR_TIMEOUT")])
def test_a_lidar_that_falls_silent_is_a_hard_stop(sensor: str, row: str) -> None:
    story = riding()
    setattr(story, sensor, None)
    story.run(0.6).expect(DEGRADED, (row,), linear_mps=0.0)
    assert story.verdict.limit.is_hard_stop()


def test_stale_sight_brakes_hard_before_the_row_is_raised() -> None:
    story = riding()
    story.obstacles = None  # the newest cloud has just arrived
    story.before(SIGHT_STALE_S).expect(NORMAL, (), linear_mps=1.5, reason="")
    story.past().expect(NORMAL, (), linear_mps=0.0, reason="SIGHT_STALE")
    assert story.verdict.limit.is_hard_stop()
    story.before(STALE_S - SIGHT_STALE_S - TICK_S).expect(NORMAL, (), linear_mps=0.0, reason="SIGHT_STALE")
    story.past().expect(DEGRADED, ("OBSTACLES_TIMEOUT",), linear_mps=0.0)
    assert story.verdict.limit.is_hard_stop()


def test_one_cloud_ends_the_limit_of_stale_sight() -> None:
    story = riding()
    story.obstacles = None
    story.run(SIGHT_STALE_S + 0.02).expect(NORMAL, (), linear_mps=0.0, reason="SIGHT_STALE")
    story.obstacles = NOTHING
    story.run(0.05).expect(NORMAL, (), linear_mps=1.5, reason="")


def test_transport_delay_of_a_cloud_counts() -> None:
    """20 clouds/s arrive on time. While their latency is above the limit, sight is stale."""
    story = riding()
    story.obstacles = None
    for latency_s, reason in ((0.1, ""), (SIGHT_STALE_S + 0.01, "SIGHT_STALE"), (0.1, "")):
        for _ in range(5):
            story.monitor.observation.obstacles(NOTHING, latency_s, story.now_s)
            story.run(0.05)
        story.expect(NORMAL, (), linear_mps=0.0 if reason else 1.5, reason=reason)


def test_stale_sight_limits_a_slow_robot_to_the_unseen_speed() -> None:
    story = riding()
    story.wheel_radps = 0.25 / ROBOT.wheel_radius_m
    story.obstacles = None
    story.run(SIGHT_STALE_S + 0.02).expect(NORMAL, (), linear_mps=0.3, reason="SIGHT_STALE")
    reach_m = math.hypot(BUMPER_M, ROBOT.footprint.width_m / 2.0)
    assert story.verdict.limit.angular_radps == pytest.approx(0.3 / reach_m)
    assert not story.verdict.limit.is_hard_stop()
    story.run(0.15).expect(DEGRADED, ("OBSTACLES_TIMEOUT",), linear_mps=0.0, reason="OBSTACLES_TIMEOUT")


def test_points_from_a_clock_that_jumps_are_no_sight() -> None:
    """If a cloud's clock is set back or far ahead, the cloud is rejected and the last accepted one ages."""
    story = riding()
    story.obstacles = None
    for latency_s in (-0.2, 5.0, math.nan, -math.inf):
        story.monitor.observation.obstacles(NOTHING, latency_s, story.now_s)
        story.run(0.05)
    story.expect(NORMAL, (), linear_mps=0.0, reason="SIGHT_STALE")


def test_a_steady_clock_that_runs_backwards_is_a_row_at_once() -> None:
    story = riding()
    story.obstacles = None
    story.tick(-1.0)
    assert "OBSTACLES_TIMEOUT" in story.verdict.faults
    assert story.verdict.limit.linear_mps == 0.0
    assert story.verdict.limit.is_hard_stop()


def test_without_perception_the_robot_brakes_hard_and_its_last_map_is_judged_until_it_stands() -> None:
    story = riding()
    story.obstacles = things(BUMPER_M + 3.4)
    story.run(0.2).expect(NORMAL, ())
    story.obstacles = None
    story.run(STALE_S + 0.06)
    assert "OBSTACLES_TIMEOUT" in story.verdict.faults
    assert story.verdict.limit.is_hard_stop()
    assert "COLLISION_IMMINENT" not in story.verdict.faults
    story.run(2.0)  # the robot does not brake: odometry moves the obstacle nearer
    assert "COLLISION_IMMINENT" in story.verdict.faults
    assert 0.0 < story.monitor.nearest_obstacle_m < 1.3
    story.wheel_radps = 0.0
    story.run(0.1)
    assert math.isnan(story.monitor.nearest_obstacle_m)


def test_obstacles_never_received_raise_no_stale_sight() -> None:
    story = Story()
    story.obstacles = None
    story.driven = RIDE
    story.wheel_radps = RIDE.vx / ROBOT.wheel_radius_m
    story.run(1.0)
    assert math.isnan(story.monitor.nearest_obstacle_m)


@pytest.mark.parametrize("before_m", [0.25, 0.5, 0.75])
def test_assumed_chair_hides_no_obstacle(before_m: float) -> None:
    story = Story().healthy()
    story.monitor.observation.chair.stated(LatchStatement(attached=False, undocking=False), story.now_s)
    story.monitor.observation.chair.on_passenger(True)
    story.obstacles = things(BUMPER_M + before_m)
    story.run(0.2)
    assert story.monitor.passenger
    assert story.monitor.nearest_obstacle_m == 0.0  # within the outline of the chair
    story.driven = story.request = RIDE
    story.run(0.1).expect(AVOIDANCE, ("COLLISION_IMMINENT", "OBSTACLE_NEAR"), linear_mps=0.0)


def test_passenger_on_the_closed_latch_is_no_obstacle() -> None:
    story = Story().carry().healthy()
    assert story.latch == CLOSED
    story.obstacles = things(BUMPER_M + 0.5)
    story.run(0.2)
    story.driven = story.request = RIDE
    story.run(0.1).expect(NORMAL, (), linear_mps=1.0, reason="PASSENGER_ONBOARD")
    assert story.monitor.nearest_obstacle_m == math.inf


def test_an_assumed_chair_is_part_of_the_outline() -> None:
    """A point 0.3 m in front of the chair is 1.2 m in front of the robot."""
    chair_m = ROBOT.footprint_with_chair.front_m
    story = Story().healthy()
    story.monitor.observation.chair.on_passenger(True)
    story.obstacles = things(chair_m + 0.3)
    story.run(0.2)
    assert story.monitor.nearest_obstacle_m == pytest.approx(0.3, abs=1e-6)

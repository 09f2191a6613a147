"""Navigation, localization and drive on the simulated physics: their nodes on the deterministic scheduler."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from robot_stack.core.geometry import Pose2, wrap_angle
from robot_stack.navigation.states import NavigationState
from tests.benchmarks.tracking import TrackedRide

GOAL = Pose2(2.5, 1.0, 0.8)


@pytest.fixture(scope="module")
def arrived() -> Iterator[TrackedRide]:
    with TrackedRide(7) as stack:
        stack.go(GOAL)
        assert stack.scheduler.run_for(20.0, lambda: stack.samples[-1].output.reached)
        yield stack


def test_the_robot_stands_at_its_goal(arrived: TrackedRide) -> None:
    truth, twist = arrived.truth()
    assert truth.distance_to(GOAL) < 0.05
    assert abs(wrap_angle(truth.yaw - GOAL.yaw)) < math.radians(2.0)
    assert twist.speed() < 0.02


def test_it_keeps_to_its_plan(arrived: TrackedRide) -> None:
    driving = [sample for sample in arrived.samples if sample.output.state is NavigationState.DRIVING]
    assert len(driving) > 50
    for sample in driving:
        assert sample.output.planned is not None
        assert sample.truth.distance_to(sample.output.planned) < 0.03


def test_the_estimate_is_near_the_truth(arrived: TrackedRide) -> None:
    for sample in arrived.samples[20:]:
        assert sample.located is not None
        assert sample.located.pose.distance_to(sample.truth) < 0.02
        assert abs(wrap_angle(sample.located.pose.yaw - sample.truth.yaw)) < math.radians(0.5)

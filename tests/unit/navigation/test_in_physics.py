"""Navigation, localization and drive on the simulated physics: their nodes on the deterministic scheduler."""

from __future__ import annotations

import math

from robot_stack.core.geometry import Pose2, wrap_angle
from robot_stack.navigation.states import NavigationState
from tests.benchmarks.tracking import TrackedRide


def test_the_robot_keeps_to_its_plan_and_stands_at_its_goal() -> None:
    goal = Pose2(2.5, 1.0, 0.8)
    with TrackedRide(7) as stack:
        stack.go(goal)
        assert stack.scheduler.run_for(20.0, lambda: stack.samples[-1].output.reached)
        truth, twist = stack.truth()
    assert truth.distance_to(goal) < 0.05
    assert abs(wrap_angle(truth.yaw - goal.yaw)) < math.radians(2.0)
    assert twist.speed() < 0.02
    driving = [sample for sample in stack.samples if sample.output.state is NavigationState.DRIVING]
    assert len(driving) > 50
    for sample in driving:
        assert sample.output.planned is not None
        assert sample.truth.distance_to(sample.output.planned) < 0.03
    for sample in stack.samples[20:]:
        assert sample.located is not None
        assert sample.located.pose.distance_to(sample.truth) < 0.02
        assert abs(wrap_angle(sample.located.pose.yaw - sample.truth.yaw)) < math.radians(0.5)

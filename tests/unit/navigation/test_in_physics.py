"""The kernels of navigation, localization and drive on the simulated physics, in lockstep."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.geometry import IDENTITY, Pose2, wrap_angle
from robot_stack.navigation.states import NavigationState
from sim.bench.kernel_stack import KernelStack
from sim.plant.world import Setup
from sim.worldfile import load_world

GOAL = Pose2(2.5, 1.0, 0.8)


@pytest.fixture(scope="module")
def arrived() -> KernelStack:
    stack = KernelStack(Setup(load_world("flat"), 7, IDENTITY))
    stack.run(lambda: False, 3.0)
    stack.goal(GOAL)
    assert stack.run(lambda: bool(stack.samples) and stack.samples[-1].output.reached, 20.0)
    return stack


def test_the_robot_stands_at_its_goal(arrived: KernelStack) -> None:
    truth, twist = arrived.truth()
    assert truth.distance_to(GOAL) < 0.05
    assert abs(wrap_angle(truth.yaw - GOAL.yaw)) < math.radians(2.0)
    assert twist.speed() < 0.02


def test_it_keeps_to_its_plan(arrived: KernelStack) -> None:
    driving = [sample for sample in arrived.samples if sample.output.state is NavigationState.DRIVING]
    assert len(driving) > 50
    for sample in driving:
        assert sample.output.planned is not None
        assert sample.truth.distance_to(sample.output.planned) < 0.03


def test_the_estimate_is_near_the_truth(arrived: KernelStack) -> None:
    for sample in arrived.samples[20:]:
        assert sample.located is not None
        assert sample.located.pose.distance_to(sample.truth) < 0.02
        assert abs(wrap_angle(sample.located.pose.yaw - sample.truth.yaw)) < math.radians(0.5)

"""Commands of any size are judged by their direction, and no command crashes the monitor."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.contract.frames import JOINTS
from robot_stack.contract.model import SafetyState
from robot_stack.core.geometry import Twist2
from robot_stack.safety.commands import SOURCES, CommandWatch
from robot_stack.safety.watches import joint_states_problem
from tests.unit.safety.story import Story

NORMAL, DEGRADED, AVOIDANCE, EMERGENCY = SafetyState
HUGE = 1.7e308
AROUND = np.array([(x, y, 0.5) for x in (-1.0, 0.0, 0.7, 3.0) for y in (-0.45, 0.45)], np.float32)


@pytest.mark.parametrize(
    "twist", [Twist2(HUGE, 0.0, HUGE), Twist2(HUGE, HUGE, 0.0), Twist2(-HUGE, HUGE, -HUGE), Twist2(0.0, 0.0, HUGE)]
)
@pytest.mark.parametrize("source", SOURCES)
def test_a_huge_command_stops_the_robot_and_not_the_monitor(twist: Twist2, source: str) -> None:
    story = Story().healthy()
    story.obstacles = AROUND
    for _ in range(10):
        story.monitor.observation.commands.request(source, twist, story.now_s)
        story.monitor.observation.commands.limited(twist, story.now_s)
        story.driven = None
        story.tick()
    story.expect(AVOIDANCE, linear_mps=0.0)


def test_a_command_keeps_its_direction_and_an_ordinary_one_is_as_it_is() -> None:
    watch = CommandWatch(0.5)
    watch.request("/cmd_vel", Twist2(3.0, -4.0, 1.0), 0.0)
    assert watch.requested(0.0) == Twist2(3.0, -4.0, 1.0)
    watch.request("/cmd_vel", Twist2(3e200, -4e200, 0.0), 0.0)
    wanted = watch.requested(0.0)
    assert (wanted.vx, wanted.vy) == pytest.approx((60.0, -80.0))
    watch.limited(Twist2(0.0, 3e200, 0.0), 0.0)
    assert watch.driven(0.0) == Twist2(0.0, 100.0, 0.0)
    watch.limited(Twist2(math.nan, 0.0, 0.0), 0.1)
    assert watch.driven(0.1) == Twist2(0.0, 100.0, 0.0)
    watch.request("/cmd_vel", Twist2(math.inf, 0.0, 0.0), 0.1)
    assert watch.requested(0.1) == Twist2(0.0, 0.0, 0.0)


def test_leading_source_of_commands() -> None:
    watch = CommandWatch(0.5)
    assert watch.leading(0.0) is None
    watch.request("/cmd_vel", Twist2(0.0, 0.0, 0.0), 0.0)
    watch.request("/docking/cmd_vel", Twist2(0.0, 0.0, 0.0), 0.3)
    assert [watch.leading(now_s) for now_s in (0.3, 0.8, 0.9)] == ["/docking/cmd_vel", "/docking/cmd_vel", None]


@pytest.mark.parametrize(("radps", "refused"), [(1e4, False), (-1e4, False), (1.001e4, True), (-HUGE, True)])
def test_joint_states_that_no_axis_can_have_count_as_not_received(radps: float, refused: bool) -> None:
    problem = joint_states_problem(JOINTS, [0.0] * 8, [radps, *[0.0] * 7])
    assert bool(problem) == refused

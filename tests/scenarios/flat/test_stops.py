"""Priorities of the control chain, and the world clock that waits for the stick."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import pytest

from robot_stack.core.world_clock import WorldClock
from tests.support.rights import needs_rights
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(900)


@needs_rights
def test_stop_chain_has_the_highest_priority(stack: StackUnderTest) -> None:
    def priority(name: str) -> int:
        return os.sched_getparam(stack.process(name)["pid"]).sched_priority

    assert [priority(name) for name in ("safety_monitor", "swerve_hardware_interface")] == [5, 5]
    assert [priority(name) for name in ("perception_pipeline", "mission_manager")] == [0, 0]


def test_the_simulated_world_waits_for_a_stick_that_is_held_up(stack: StackUnderTest) -> None:
    """A short delay of the test process does not count as a release of the stick."""
    clock = WorldClock.find()
    assert clock is not None
    stack.drive_at(0.4)
    start = len(stack.truth.items)
    with stack.stick.held_up():
        wait_for(lambda: "stick" in clock.waiting_for, "the world waits for the stick")
    wait_for(lambda: len(stack.truth.items) > start + 50, "another second of the ride")
    assert min(m.twist.twist.linear.x for m in stack.truth.messages[start:]) > 0.3

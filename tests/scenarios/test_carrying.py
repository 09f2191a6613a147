"""The main job: a mission fetches a wheelchair, carries it to its destination and puts it down."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from robot_stack.core.geometry import Pose2
from tests.support.environment import own_config, stack_environment

if TYPE_CHECKING:
    from tests.support.docking_stack import DockingStackUnderTest

pytestmark = pytest.mark.timeout(900)

# Beside the staging pose, at which the robot believes to stand: without a map it carries that error along.
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


@pytest.fixture
def docking(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DockingStackUnderTest]:
    folder = tmp_path_factory.mktemp("transport")
    with stack_environment(folder), own_config(folder, carry=MISSION):
        from tests.support.docking_stack import DockingStackUnderTest

        stack = DockingStackUnderTest(folder / "logs", START)
        yield stack
        stack.close()


def test_a_wheelchair_is_fetched_carried_and_put_down(docking: DockingStackUnderTest) -> None:
    docking.make_ready()
    begun = len(docking.safety.items)
    docking.command("START_MISSION", "carry")
    docking.passenger.wait(lambda message: message.data, "the wheelchair on the latch", 150.0)
    docking.mission.wait(
        lambda message: message.current_waypoint == "destination", "on the way to the destination", 90.0
    )
    assert docking.passenger.last.data
    assert docking.limit.last.max_linear_velocity <= 1.0
    docking.passenger.wait(lambda message: not message.data, "the wheelchair put down", 90.0)
    docking.mission.wait(lambda message: message.state == "COMPLETED", "the mission's end", 90.0)

    docking.wait_stands()
    chair = docking.wheelchair()
    staging = docking.dock.staging.pose()
    believed = DESTINATION.compose(docking.dock.dock_pose.pose().inverse())
    expected = staging.compose(START).compose(staging.inverse()).compose(believed)
    assert chair.distance_to(expected) < 0.10  # navigation's tolerance and the wheels' drift
    assert docking.at().distance_to(chair) > 2.0
    assert "EMERGENCY_STOP" not in {message.safety_state for message in docking.safety.messages[begun:]}

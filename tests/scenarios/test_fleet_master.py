"""The demonstration's transport, ordered by a foreign fleet manager over a real broker, on the whole robot."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

from custom_msgs.msg import MissionOrder
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract import services
from robot_stack.core.geometry import Pose2
from sim.settings import FEW_BEAMS, SHORT_START, pose_settings, world_settings
from tests.simulated.test_fleet import first_part, second_part
from tests.support.environment import stack_environment
from tests.support.fleet.broker import running_broker

pytestmark = pytest.mark.timeout(1800)
DEADLINE_S = 1500.0  # only ends a failing ride


def test_a_transport_in_two_updates(tmp_path: Path) -> None:
    settings = [
        *world_settings("yard"),
        *FEW_BEAMS,
        *pose_settings("sim_world.start", SHORT_START),
        *pose_settings("ndt_localization.start", SHORT_START),
    ]
    with running_broker(tmp_path / "site", local=True) as broker, stack_environment(tmp_path):
        from robot_stack.contract import topics
        from tests.support.fleet.foreign_masters import drive_by_sdk
        from tests.support.stack import StackUnderTest, true_pose

        url = broker.site.robot_url()
        with closing(StackUnderTest(tmp_path / "logs", *settings, fleet=url)) as stack:
            bodies = stack.peer.listen(topics.SIM_BODIES)
            # A release before the pose is known is refused. With the next message the mission manager has the first.
            first = stack.wait_safety("NORMAL")
            stack.safety.wait(lambda message: message is not first, "another safety status")
            release = EditMissionQueue.Request(
                operation=EditMissionQueue.Request.RELEASE, order=MissionOrder(origin="cli")
            )
            answer = stack.peer.call(services.EDIT_MISSION_QUEUE, release)
            assert answer.success, answer.message
            followed = drive_by_sdk(url, "robot_stack", "robot_1", first_part(), second_part(), deadline_s=DEADLINE_S)
            assert followed.accepted, followed
            assert followed.finished, followed
            assert followed.nodes == ["start", "pick-up", "back out", "corner", "north path", "destination", "clear"]
            assert "orderAborted" not in followed.errors
            stack.wait_stands()
            bodies.wait(
                lambda message: true_pose(message, "wheelchair").distance_to(Pose2(3.9, 13.0, 0.0)) < 0.5,
                "the chair at its destination",
            )

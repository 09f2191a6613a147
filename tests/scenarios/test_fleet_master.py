"""A ride ordered by a foreign fleet manager over a real broker, on the whole robot. A transport: tests/simulated."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

from custom_msgs.msg import MissionOrder
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract import services
from robot_stack.core.geometry import Pose2
from tests.support.environment import stack_environment
from tests.support.fleet.broker import running_broker
from tests.support.waiting import wait_for
from tests.unit.fleet.master import node, order

pytestmark = pytest.mark.timeout(900)
DEADLINE_S = 600.0  # only ends a failing ride
FIRST = order(
    [node("start", 0, 0.0, allowedDeviationXY=0.5), node("passed", 2, 1.0), node("end", 4, 2.0, released=False)]
)
SECOND = order([node("passed", 2, 1.0), node("end", 4, 2.0)], update=1)


def test_a_ride_in_two_updates(tmp_path: Path) -> None:
    with running_broker(tmp_path / "site", local=True) as broker, stack_environment(tmp_path):
        from tests.support.fleet.foreign_masters import drive_by_sdk
        from tests.support.stack import FLAT, StackUnderTest

        url = broker.site.robot_url()
        settings = (*FLAT, "mission_manager.next_order_after_s=1.0")
        with closing(StackUnderTest(tmp_path / "logs", *settings, fleet=url)) as stack:
            stack.wait_safety("NORMAL")
            release = EditMissionQueue.Request(
                operation=EditMissionQueue.Request.RELEASE, order=MissionOrder(origin="cli")
            )
            # Refused before the mission manager has the pose and the state NORMAL, too.
            wait_for(lambda: stack.peer.call(services.EDIT_MISSION_QUEUE, release).success, "the release", poll_s=0.2)
            followed = drive_by_sdk(url, "robot_stack", "robot_1", FIRST, SECOND, deadline_s=DEADLINE_S)
            assert followed.accepted, followed
            assert followed.finished, followed
            assert followed.nodes == ["start", "passed", "end"]
            assert "orderAborted" not in followed.errors
            stack.wait_stands()
            assert stack.at().distance_to(Pose2(2.0, 0.0, 0.0)) < 0.15

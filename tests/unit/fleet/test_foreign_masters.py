"""The foreign fleet manager for tests of the fleet agent: it drives a robot by the same library over a real broker."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from tests.support.fleet.broker import running_broker
from tests.support.fleet.foreign_masters import drive_by_sdk
from tests.support.fleet.foreign_robot import MAKER, ForeignRobot
from tests.support.fleet.orders import order


def test_sdk_sends_an_order_and_follows_it(tmp_path: Path) -> None:
    with (
        running_broker(tmp_path / "site", local=True) as broker,
        closing(ForeignRobot(broker.site.robot_url(), "F1")) as robot,
    ):
        followed = drive_by_sdk(broker.site.robot_url(), MAKER, "F1", order("o-1", ["start", "a", "b"]))
        assert followed.accepted
        assert followed.finished, followed
        assert followed.nodes[-1] == "b"
        assert followed.errors == []
        assert robot.orders == ["o-1"]
        refused = drive_by_sdk(broker.site.robot_url(), MAKER, "F1", order("o-2", ["elsewhere", "a"]))
        assert not refused.accepted, "it knows that the robot cannot reach the first node"

"""Foreign fleet managers and a foreign robot over a real broker: vda5050-sdk and vda-5050-lib."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner

from robot_stack.cli.app import app
from robot_stack.core.geometry import Pose2
from tests.benchmarks.support.fleet_many import Member
from tests.support.fleet.broker import running_broker
from tests.support.fleet.foreign_masters import drive_by_npm, drive_by_sdk, installed_npm, npm_robot
from tests.support.fleet.foreign_robot import MAKER, ForeignRobot
from tests.support.fleet.orders import order


@pytest.fixture(scope="module")
def npm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return installed_npm(tmp_path_factory.mktemp("npm"))


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


def test_vda_5050_lib_sends_an_order_and_follows_it(npm: Path, tmp_path: Path) -> None:
    with running_broker(tmp_path / "site", local=True) as broker:
        robot = Member("F1", broker.params(), tmp_path / "robot", Pose2(1.0, 2.0, 0.0))
        maker, sent = robot.vehicle.params.identity.manufacturer, order("o-1", ["start", "a", "b"])
        with closing(robot.link):
            url = broker.site.robot_url()
            followed = drive_by_npm(npm, url, maker, "F1", sent, lambda: robot.visit(also_idle=True))
    assert followed.finished, followed
    assert followed.nodes[-1] == "b"
    assert followed.errors == []
    assert robot.vehicle.pose.distance_to(Pose2(3.0, 2.0, 0.0)) < 0.3


def test_virtual_agv_of_vda_5050_lib_is_ordered_by_the_command_line(npm: Path, tmp_path: Path) -> None:
    file = tmp_path / "order.json"
    file.write_text(json.dumps(order("o-1", ["start", "a", "b"], serialNumber="V1")), encoding="utf-8")
    with (
        running_broker(tmp_path / "site", local=True) as broker,
        npm_robot(npm, broker.site.robot_url(), MAKER, "V1"),
    ):
        folder = ["--folder", str(broker.site.folder)]
        result = CliRunner().invoke(app, ["fleet", "send", str(file), *folder])
        assert result.exit_code == 0, result.exception
        assert result.output.splitlines()[-1] == "V1: order o-1 is finished"
        shown = json.loads(CliRunner().invoke(app, ["fleet", "status", "--json", *folder]).output)
        assert shown[f"uagv/v2/{MAKER}/V1"]["state"]["lastNodeId"] == "b"

"""Profile robot on devices simulated at their wires: its own drivers measure, and the robot rides by them.

The world waits for the stack, and each device for its driver, so nothing depends on the machine's speed.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from robot_stack.core.runtime import runtime_dir
from robot_stack.supervisor.control import ask
from robot_stack.supervisor.profile import load_plan
from sim.devices import v4l2
from sim.devices.udp import free_port
from sim.settings import wire_settings, world_settings
from tests.support.environment import stack_environment
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(1800)
# By row of the contract.
DRIVERS = {
    "LIDAR_POINTS": "ouster_driver",
    "OVERHEAD_LIDAR_POINTS": "overhead_lidar_adapter",
    "IMU": "xsens_driver",
    "BATTERY_STATE": "pylontech_driver",
    "FRONT_IMAGE": "v4l2_camera_driver",
    "REAR_IMAGE": "v4l2_camera_driver",
}
# Of what no wire of the simulation loses, by the driver that counts it.
LOSSES = {
    "ouster_driver": ("packets lost", "packets corrupt", "packets of others", "clock jumps"),
    "xsens_driver": ("samples lost", "frames corrupt", "samples refused", "clock jumps"),
    "pylontech_driver": ("frames corrupt", "frames refused"),
    "v4l2_camera_driver": ("front corrupt frames", "rear corrupt frames", "front lost frames", "rear lost frames"),
}


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StackUnderTest]:
    folder = tmp_path_factory.mktemp("stack")
    with stack_environment(folder), pytest.MonkeyPatch.context() as monkeypatch:
        from tests.support.stack import StackUnderTest

        for name, value in v4l2.environment(v4l2.build_library(folder), runtime_dir() / "cameras").items():
            monkeypatch.setenv(name, value)
        settings = (*world_settings("flat"), *wire_settings(free_port()))
        stack = StackUnderTest(folder / "logs", *settings, profile="robot_simulated")
        yield stack
        stack.close()


def test_the_robot_drives_by_its_own_drivers(stack: StackUnderTest) -> None:
    """It docks and carries by them, too: test_demo.py."""
    from robot_stack.cli import robot_checks
    from robot_stack.cli.checks import Level
    from robot_stack.contract import topics

    replaced = load_plan("robot").processes
    robot = {process.name for process in replaced} - {"point_cloud_adapter"} | {"ouster_driver"}
    states = {item["name"]: item["state"] for item in ask("status")["processes"]}
    assert {name: states.get(name) for name in robot} == dict.fromkeys(robot, "ready")

    for key, driver in DRIVERS.items():
        row = topics.ROWS[key]
        received = stack.peer.listen(row)
        received.wait(lambda _: True, f"a message on {row.name}")
        publishers = stack.peer.node.get_publishers_info_by_topic(row.name)
        assert [info.node_name for info in publishers] == [driver], row.name
        stack.peer.node.destroy_subscription(received.subscription)

    found = [*robot_checks.engine(), *robot_checks.level(), *robot_checks.display()]
    assert [finding for finding in found if finding.level is not Level.OK] == []
    assert {finding.check for finding in found} == {
        "axes", "home", "hardware stop", "inertial unit", "external display",
    }  # fmt: skip
    # Rates are not compared: a measurement takes a few seconds, in which a slow world sends few messages.
    measured = {finding.what.partition(" ")[0].rstrip(":") for finding in robot_checks.sensors()}
    assert {topics.ROWS[key].name for key in DRIVERS} <= measured

    diagnostics = stack.peer.listen(topics.DIAGNOSTICS)
    stack.make_ready()
    stack.drive_at(0.5)
    stack.let_go()
    stack.wait_stands(10.0)
    values: dict[str, dict[str, str]] = {}

    def all_reported() -> bool:
        for message in diagnostics.messages:
            for status in message.status:
                values[status.name] = {item.key: item.value for item in status.values}
        return LOSSES.keys() <= values.keys()

    wait_for(all_reported, "the drivers' diagnostics")
    counted = {f"{driver}: {name}": values[driver][name] for driver, names in LOSSES.items() for name in names}
    assert counted == dict.fromkeys(counted, "0")

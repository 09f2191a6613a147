"""The DDS settings of a process, independent of its parent's settings."""

from __future__ import annotations

import pytest

from robot_stack.contract import processes, topics
from robot_stack.core.config import config_dir
from robot_stack.ros import transport

SHARED, UDP, NETWORK = (str(config_dir() / f"{name}.xml") for name in ("fastdds", "fastdds_udp", "fastdds_network"))


def applied(environment: dict[str, str], bulk: bool) -> tuple[str, str]:
    transport.apply(environment, bulk=bulk)
    return environment[transport.PROFILE], environment[transport.REACH]


@pytest.mark.parametrize(("bulk", "chosen"), [(False, (UDP, "SYSTEM_DEFAULT")), (True, (SHARED, "SYSTEM_DEFAULT"))])
@pytest.mark.parametrize("start", [{}, {transport.REACH: "LOCALHOST"}])
def test_only_bulk_has_shared_memory(start: dict[str, str], bulk: bool, chosen: tuple[str, str]) -> None:
    assert applied(dict(start), bulk) == chosen


@pytest.mark.parametrize("parent", [False, True])
@pytest.mark.parametrize("child", [False, True])
def test_a_parent_does_not_decide_for_its_child(parent: bool, child: bool) -> None:
    environment: dict[str, str] = {}
    transport.apply(environment, bulk=parent)
    assert applied(environment, child) == applied({}, child)


@pytest.mark.parametrize("child", [False, True])
def test_a_child_talks_as_far_as_its_parent(child: bool) -> None:
    environment = {transport.REACH: "SUBNET"}
    transport.apply(environment, bulk=True)
    assert applied(environment, child) == (NETWORK, "SUBNET")


@pytest.mark.parametrize("bulk", [False, True])
def test_who_opens_the_network_or_has_a_profile_of_their_own_keeps_it(bulk: bool) -> None:
    assert applied({transport.REACH: "SUBNET"}, bulk) == (NETWORK, "SUBNET")
    assert applied({transport.PROFILE: "/mine.xml"}, bulk) == ("/mine.xml", "LOCALHOST")


def test_every_sender_of_bulk_is_a_process_of_the_table() -> None:
    senders = {name for row in topics.TOPICS if row.bulk for name in row.publishers} - set(topics.OUTSIDE)
    real = {
        "point_cloud_adapter",
        "overhead_lidar_adapter",
        "velodyne_driver",
        "ouster_driver",
        "v4l2_camera_driver",
        "camera_adapter",
    }
    simulated = {"lidar_driver", "overhead_lidar_driver", "camera_driver"}
    assert senders == {*simulated, *real} <= processes.BY_NAME.keys()

"""The DDS settings of a process, independent of its parent's settings."""

from __future__ import annotations

import pytest

from robot_stack.contract import processes, topics
from robot_stack.core.config import config_dir
from robot_stack.ros import transport

SHARED, UDP, NETWORK, NETWORK_UDP = (
    str(config_dir() / f"{name}.xml") for name in ("fastdds", "fastdds_udp", "fastdds_network", "fastdds_network_udp")
)


def applied(environment: dict[str, str], bulk: bool) -> tuple[str, str]:
    transport.apply(environment, bulk=bulk)
    return environment[transport.PROFILE], environment[transport.REACH]


@pytest.mark.parametrize(
    ("start", "reach", "udp", "shared"),
    [
        ({}, "SYSTEM_DEFAULT", UDP, SHARED),
        ({transport.REACH: "LOCALHOST"}, "SYSTEM_DEFAULT", UDP, SHARED),
        ({transport.REACH: "SUBNET"}, "SUBNET", NETWORK_UDP, NETWORK),
    ],
)
def test_only_bulk_has_shared_memory(
    start: dict[str, str], reach: str, udp: str, shared: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for bulk, profile in ((False, udp), (True, shared)):
        assert applied(dict(start), bulk) == (profile, reach)
        monkeypatch.setenv(transport.PROFILE, profile)
        assert transport.carries_bulk() is bulk


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
    assert applied(environment, child) == (NETWORK if child else NETWORK_UDP, "SUBNET")


@pytest.mark.parametrize("bulk", [False, True])
def test_a_profile_of_the_users_own_is_kept(bulk: bool) -> None:
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

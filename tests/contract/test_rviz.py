"""``config/rviz/robot.rviz``: each display and tool has a topic of the contract, with its type, QoS and direction."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest

from robot_stack.contract import frames, topics
from robot_stack.contract.model import Durability, Reliability, Topic
from robot_stack.core.config import config_dir, read_yaml

PATH = config_dir() / "rviz" / "robot.rviz"
BY_NAME = {row.name: row for row in topics.TOPICS}
RVIZ = "rviz"
# The message that a display of rviz_default_plugins subscribes to, or a tool publishes.
TYPES = {
    "Image": "sensor_msgs/msg/Image",
    "Map": "nav_msgs/msg/OccupancyGrid",
    "MarkerArray": "visualization_msgs/msg/MarkerArray",
    "Odometry": "nav_msgs/msg/Odometry",
    "Path": "nav_msgs/msg/Path",
    "PointCloud2": "sensor_msgs/msg/PointCloud2",
    "Pose": "geometry_msgs/msg/PoseStamped",
    "PoseWithCovariance": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "RobotModel": "std_msgs/msg/String",
    "SetGoal": "geometry_msgs/msg/PoseStamped",
    "SetInitialPose": "geometry_msgs/msg/PoseWithCovarianceStamped",
}
WITHOUT_TOPIC = {"FocusCamera", "Grid", "Interact", "Measure", "MoveCamera", "Select", "TF"}
RELIABILITY = {"Reliable": Reliability.RELIABLE, "Best Effort": Reliability.BEST_EFFORT}
DURABILITY = {"Volatile": Durability.VOLATILE, "Transient Local": Durability.TRANSIENT_LOCAL}


class Endpoint(NamedTuple):
    """plugin: class name. key: of the property. settings: topic and QoS."""

    plugin: str
    key: str
    settings: dict[str, Any]

    @property
    def topic(self) -> str:
        return str(self.settings["Value"])


def endpoints(items: list[dict[str, Any]]) -> Iterator[Endpoint]:
    for item in items:
        plugin = item["Class"].removeprefix("rviz_default_plugins/")
        topics_of = {
            key: value for key, value in item.items() if isinstance(value, dict) and "Reliability Policy" in value
        }
        assert bool(topics_of) is (plugin not in WITHOUT_TOPIC), item["Class"]
        yield from (Endpoint(plugin, key, value) for key, value in topics_of.items())


MANAGER = read_yaml(PATH)["Visualization Manager"]
SHOWN = list(endpoints(MANAGER["Displays"]))
UPDATES = [item for item in SHOWN if item.key == "Update Topic"]
SUBSCRIBED = [item for item in SHOWN if item.key != "Update Topic"]
PUBLISHED = list(endpoints(MANAGER["Tools"]))


@pytest.mark.parametrize("item", [*SUBSCRIBED, *PUBLISHED], ids=lambda item: f"{item.plugin}:{item.topic}")
def test_topic_type_and_qos_are_those_of_the_row(item: Endpoint) -> None:
    row: Topic = BY_NAME[item.topic]
    assert row.type == TYPES[item.plugin]
    assert RELIABILITY[item.settings["Reliability Policy"]] is row.qos.reliability
    assert DURABILITY[item.settings["Durability Policy"]] is row.qos.durability
    assert item.settings["History Policy"] == "Keep Last"
    assert item.settings["Depth"] == row.qos.depth


@pytest.mark.parametrize("item", PUBLISHED, ids=lambda item: item.topic)
def test_rviz_may_publish_what_its_tools_publish(item: Endpoint) -> None:
    assert RVIZ in BY_NAME[item.topic].publishers


def test_updates_belong_to_maps_and_have_no_publisher() -> None:
    """The display needs a topic there; the stack publishes whole grids."""
    assert [item.topic for item in UPDATES] == [f"{item.topic}_updates" for item in SUBSCRIBED if item.plugin == "Map"]
    assert not {item.topic for item in UPDATES} & set(BY_NAME)


def test_what_an_operator_needs_is_shown() -> None:
    rows = (topics.MAP, topics.MAP_CLOUD, topics.LOCAL_COSTMAP, topics.ROBOT_DESCRIPTION, topics.PLAN)
    rows += (topics.OBSTACLES, topics.NAVIGATION_PEOPLE, topics.LOCALIZATION_POSE)
    enabled = {item["Name"]: item["Enabled"] for item in MANAGER["Displays"]}
    shown = {item.topic for item in endpoints([item for item in MANAGER["Displays"] if item["Enabled"]])}
    assert {row.name for row in rows} <= shown, enabled
    assert {item.topic for item in PUBLISHED} == {topics.INITIAL_POSE.name, topics.GOAL_POSE.name}
    assert MANAGER["Global Options"]["Fixed Frame"] == frames.MAP


def test_bulk_topics_are_off_until_switched_on() -> None:
    """A viewer that only opens the file loads neither processor nor network with clouds of 2.4 MB and images."""
    on = [item for item in MANAGER["Displays"] if item["Enabled"]]
    assert [item.topic for item in endpoints(on) if item.topic in BY_NAME and BY_NAME[item.topic].bulk] == []

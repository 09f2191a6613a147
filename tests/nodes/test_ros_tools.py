"""Nodes as Nav2 and RViz see them: their QoS receives our topics, and rcl reads the parameter file for Nav2."""

from __future__ import annotations

from typing import Any, NamedTuple

import pytest
import rclpy
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    QoSProfile,
    qos_profile_sensor_data,
    qos_profile_system_default,
)
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import String

from robot_stack.contract import frames, topics
from robot_stack.core.config import config_dir, read_yaml
from tests.support.peer import Peer
from tests.support.processes import Start
from tests.support.waiting import wait_for
from tf2_msgs.msg import TFMessage

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Tool(NamedTuple):
    """A subscription of Nav2 (Jazzy) or RViz: nav2_costmap_2d/static_layer.cpp, nav2_util/odometry_utils.cpp,
    rviz_default_plugins, tf2_ros/qos.hpp."""

    topic: str
    kind: type
    qos: QoSProfile


TOOLS = (
    Tool("/map", OccupancyGrid, LATCHED),
    Tool("/map_cloud", PointCloud2, LATCHED),
    Tool("/robot_description", String, LATCHED),
    Tool("/odom", Odometry, qos_profile_system_default),
    Tool("/tf", TFMessage, QoSProfile(depth=100)),
    Tool("/joint_states", JointState, qos_profile_sensor_data),
)


def test_subscriptions_of_nav2_and_rviz_receive_map_model_odometry_and_transforms(start: Start, peer: Peer) -> None:
    received: dict[str, Any] = {}
    moving: set[str] = set()  # child frames; each node publishes its own
    start("ndt_localization")
    start("swerve_controller")
    clock = peer.node.get_clock()

    def receive(topic: str, message: Any) -> None:
        received.setdefault(topic, message)
        if topic == "/tf":
            moving.update(item.child_frame_id for item in message.transforms)

    def joint_states() -> JointState:
        message = JointState(name=list(frames.JOINTS), position=[0.1] * len(frames.JOINTS))
        message.header.stamp = clock.now().to_msg()
        return message

    peer.repeat(topics.JOINT_STATES, joint_states, 50.0)
    wait_for(lambda: peer.node.count_publishers("/map") and peer.node.count_publishers("/odom"), "both nodes")
    for tool in TOOLS:  # after the latched messages were published
        peer.node.create_subscription(
            tool.kind, tool.topic, lambda message, topic=tool.topic: receive(topic, message), tool.qos
        )
    wait_for(lambda: len(received) == len(TOOLS), "a message on each topic")
    assert received["/map"].info.width * received["/map"].info.height == len(received["/map"].data)
    assert received["/robot_description"].data.startswith("<?xml")
    wait_for(lambda: {frames.wheel_link("fl"), frames.ODOM} <= moving, "the transforms of both nodes")


@pytest.mark.usefixtures("ros_domain")
@pytest.mark.parametrize("name", list(read_yaml(config_dir() / "nav2" / "nav2_params.yaml")))
def test_rcl_reads_the_parameters_of_each_nav2_node(name: str) -> None:
    """rcl's parser knows less of YAML than Python's, e.g. no aliases and no lists of mixed numbers."""
    path = config_dir() / "nav2" / "nav2_params.yaml"
    tree = read_yaml(path)[name]
    nested = "ros__parameters" not in tree
    expected = (tree[name] if nested else tree)["ros__parameters"]
    context = Context()
    rclpy.init(args=["--ros-args", "--params-file", str(path)], context=context)
    try:
        node = Node(
            name,
            context=context,
            namespace=name if nested else None,
            automatically_declare_parameters_from_overrides=True,
        )
        read = node.get_parameters_by_prefix("")
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)
    flat = dict(_flat(expected))
    assert {key: _plain(read[key].value) for key in flat} == flat


def _flat(tree: dict[str, Any], path: str = "") -> list[tuple[str, Any]]:
    items: list[tuple[str, Any]] = []
    for key, value in tree.items():
        items += _flat(value, f"{path}{key}.") if isinstance(value, dict) else [(f"{path}{key}", value)]
    return items


def _plain(value: Any) -> Any:
    return list(value) if hasattr(value, "typecode") or isinstance(value, tuple) else value

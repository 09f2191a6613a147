"""``config/nav2/nav2_params.yaml``: footprint, limits, topics and frames are the robot's; plugins have parameters."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator
from typing import Any

import pytest

from robot_stack.contract import frames, topics
from robot_stack.core.config import config_dir, load, read_yaml
from robot_stack.core.robot import load_robot
from robot_stack.mission.params import MissionParams

ROBOT = load_robot()
FILE = read_yaml(config_dir() / "nav2" / "nav2_params.yaml")
NODES: dict[str, dict[str, Any]] = {
    name: (tree if "ros__parameters" in tree else tree[name])["ros__parameters"] for name, tree in FILE.items()
}
COSTMAPS = ("local_costmap", "global_costmap")


def entries(tree: dict[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from entries(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


@pytest.mark.parametrize("costmap", COSTMAPS)
def test_footprint_is_the_robots_and_inflation_covers_it(costmap: str) -> None:
    corners = ast.literal_eval(NODES[costmap]["footprint"])
    front, rear, half = ROBOT.footprint.front_m, ROBOT.footprint.rear_m, 0.5 * ROBOT.footprint.width_m
    assert sorted(map(tuple, corners)) == sorted([(front, half), (front, -half), (rear, half), (rear, -half)])
    assert NODES[costmap]["inflation_layer"]["inflation_radius"] > max(math.hypot(x, y) for x, y in corners)


def test_limits_are_within_those_with_a_passenger() -> None:
    motion, mppi, smoother = ROBOT.with_passenger, NODES["controller_server"]["FollowPath"], NODES["velocity_smoother"]
    assert mppi["motion_model"] == "Omni"
    assert 0.0 < max(mppi["vx_max"], -mppi["vx_min"], mppi["vy_max"]) <= motion.max_speed_mps
    assert 0.0 < mppi["wz_max"] <= motion.max_yaw_rate_radps
    assert 0.0 < max(mppi["ax_max"], -mppi["ax_min"], mppi["ay_max"], -mppi["ay_min"]) <= motion.max_acceleration_mps2
    assert 0.0 < mppi["az_max"] <= motion.max_yaw_acceleration_radps2
    assert smoother["max_velocity"] == [mppi["vx_max"], mppi["vy_max"], mppi["wz_max"]]
    assert smoother["min_velocity"] == [mppi["vx_min"], -mppi["vy_max"], -mppi["wz_max"]]
    assert smoother["max_accel"] == [mppi["ax_max"], mppi["ay_max"], mppi["az_max"]]
    assert smoother["max_decel"] == [mppi["ax_min"], mppi["ay_min"], -mppi["az_max"]]
    assert NODES["behavior_server"]["max_rotational_vel"] <= mppi["wz_max"]
    assert NODES["behavior_server"]["rotational_acc_lim"] <= motion.max_yaw_acceleration_radps2


def test_commands_have_the_rate_and_the_timeout_of_cmd_vel() -> None:
    assert NODES["velocity_smoother"]["smoothing_frequency"] == topics.CMD_VEL.rate_hz
    assert NODES["controller_server"]["controller_frequency"] == topics.CMD_VEL.rate_hz
    assert NODES["velocity_smoother"]["velocity_timeout"] <= topics.CMD_VEL.stale_limit_s
    stamped = [
        NODES[name]["enable_stamped_cmd_vel"] for name in ("controller_server", "behavior_server", "velocity_smoother")
    ]
    assert stamped == [topics.CMD_VEL.type == "geometry_msgs/msg/TwistStamped"] * 3


def test_arrival_is_what_a_mission_accepts() -> None:
    mission, goal = load(MissionParams, "mission_manager"), NODES["controller_server"]["goal_checker"]
    assert goal["xy_goal_tolerance"] <= mission.position_tolerance_m
    assert goal["yaw_goal_tolerance"] <= mission.yaw_tolerance_rad


@pytest.mark.parametrize("costmap", COSTMAPS)
def test_layers_take_topics_of_the_contract(costmap: str) -> None:
    layer = NODES[costmap]["obstacle_layer"]
    sources = layer["observation_sources"].split()
    for name in sources:
        row = next(row for row in topics.TOPICS if row.name == layer[name]["topic"])
        assert row.type == f"sensor_msgs/msg/{layer[name]['data_type']}"
    assert any(layer[name]["marking"] for name in sources)
    assert any(layer[name]["clearing"] for name in sources)


def test_topics_and_frames_are_those_of_the_contract() -> None:
    names = {row.name for row in topics.TOPICS}
    known = {frames.MAP, frames.ODOM, frames.BASE_LINK}
    for node, tree in NODES.items():
        for key, value in entries(tree):
            if isinstance(value, str) and value.startswith("/"):
                assert value in names, f"{node}.{key}"
            if key.endswith("_frame"):
                assert value in known, f"{node}.{key}"
    assert NODES["global_costmap"]["static_layer"]["map_topic"] == topics.MAP.name
    assert NODES["global_costmap"]["static_layer"]["map_subscribe_transient_local"] is True


def test_every_plugin_that_is_named_has_parameters_with_its_class() -> None:
    for node, tree in NODES.items():
        lists = [
            value for key, value in tree.items() if key == "plugins" or key.endswith("_plugins") or key == "navigators"
        ]
        for name in (name for value in lists for name in value):
            assert "::" in tree[name]["plugin"], f"{node}.{name}"
    path = NODES["controller_server"]["FollowPath"]
    assert all(path[name]["enabled"] for name in path["critics"])

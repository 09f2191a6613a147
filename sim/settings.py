"""Parameters of a stack in the simulation, as ``node.parameter=value`` for its start."""

from __future__ import annotations

import math

from robot_stack.core.config import ConfigError, config_dir
from robot_stack.core.geometry import Pose2
from robot_stack.core.site_map import map_folder
from robot_stack.supervisor.profile import MAP_PARAMETERS, WORLD_NODES

_FLEET = "fleet_agent"  # in no simulated stack by itself

# A LiDAR with a sixth of its beams, for small machines and tests.
FEW_BEAMS = ("lidar_driver.columns=400", "perception_pipeline.watch.points_min=2500")

# The ride of the demonstration, and its short form, which starts near the wheelchair.
DEMO_MISSION, SHORT_MISSION, SHORT_START = "site_transport", "short_transport", Pose2(-0.3, 8.8, 2.4)
# How wrong the start that the demonstration's localization is given is.
START_ERROR_M, START_ERROR_DEG = 1.0, 10.0


def pose_settings(prefix: str, pose: Pose2) -> list[str]:
    """The three parameters of a pose, e.g. ``sim_world.start_x_m=1.0`` for the prefix ``sim_world.start``."""
    return [f"{prefix}_x_m={pose.x}", f"{prefix}_y_m={pose.y}", f"{prefix}_yaw_rad={pose.yaw}"]


def wrong_start(start: Pose2, off_m: float, off_deg: float) -> Pose2:
    """The pose that localization starts with where the robot stands at ``start``: so far away, turned by so much."""
    return Pose2(start.x + 0.8 * off_m, start.y - 0.6 * off_m, start.yaw + math.radians(off_deg))


def wire_settings(port: int) -> list[str]:
    """The port of the LiDAR's packets in the profile robot_simulated, for several stacks on one computer."""
    return [f'lidar_driver.wire="{port}"', f"ouster_driver.port={port}"]


def world_settings(world: str) -> list[str]:
    """The world in every node that simulates it, and its map, or none, in those that use one."""
    name = own_map(world)
    return [
        *(f"{node}.world={world}" for node in WORLD_NODES),
        *(f'{node}.{parameter}="{name}"' for node, parameter in MAP_PARAMETERS.items() if node != _FLEET),
    ]


def own_site(world: str) -> str:
    """The name of the site in a world: the world's own, empty if there is none."""
    return world if (config_dir() / "sites" / world).is_dir() else ""


def own_map(world: str) -> str:
    """The name of the map of a world: the world's own, empty if there is none."""
    try:
        map_folder(world)
    except ConfigError:
        return ""
    return world

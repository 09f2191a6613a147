"""Parameters of a stack in the simulation, as ``node.parameter=value`` for its start."""

from __future__ import annotations

from robot_stack.core.geometry import Pose2


def pose_settings(prefix: str, pose: Pose2) -> list[str]:
    """The three parameters of a pose, e.g. ``sim_world.start_x_m=1.0`` for the prefix ``sim_world.start``."""
    return [f"{prefix}_x_m={pose.x}", f"{prefix}_y_m={pose.y}", f"{prefix}_yaw_rad={pose.yaw}"]

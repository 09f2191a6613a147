"""The DDS settings of every process of the stack, in force before rclpy starts unless somebody has chosen others.

- Fast DDS loses most point clouds (2.4 MB) with its default shared-memory segment of 512 KiB; the profile in
  ``config/fastdds.xml`` has room for them.
- Discovery stays on this machine: nobody on the network moves the robot by accident.
"""

from __future__ import annotations

import os
from collections.abc import MutableMapping

from robot_stack.core.config import config_dir


def apply(environment: MutableMapping[str, str] = os.environ) -> None:
    """Sets what is not set yet. Raises ConfigError without a configuration folder."""
    environment.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(config_dir() / "fastdds.xml"))
    environment.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

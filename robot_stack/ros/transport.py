"""The DDS settings of every process of the stack, in force before rclpy starts unless somebody has chosen others.

- Discovery stays on this machine: nobody on the network moves the robot by accident.
- Processes talk by UDP. Fast DDS's shared memory is for those alone that exchange clouds and images (``bulk``):
  whenever a participant with shared memory comes up, every other one checks its ports one by one, 0.33 s each where
  the port is idle, and holds the lock without which it sends nothing (Fast DDS issue 6535). The chain that stops the
  wheels must not stand still because somebody started a process.
- By UDP, and with Fast DDS's own shared-memory segment of 512 KiB, most point clouds (2.4 MB) are lost; the profile
  ``config/fastdds.xml`` has room for them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager

from robot_stack.core.config import config_dir

PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"
REACH = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_LOCAL, _BY_PROFILE = "LOCALHOST", "SYSTEM_DEFAULT"


def apply(environment: MutableMapping[str, str] = os.environ, *, bulk: bool = False) -> None:
    """Sets what nobody has chosen. Raises ConfigError without a configuration folder.

    bulk: this process sends or takes clouds or images.
    """
    shared, udp = _profiles()
    if environment.get(PROFILE) == udp:  # what a parent process has chosen for itself
        environment[REACH] = _LOCAL
    reach = environment.setdefault(REACH, _LOCAL)
    if environment.get(PROFILE, shared) not in (shared, udp):
        return
    # rmw adds shared memory to every participant that it keeps on this machine: here the profile does that itself.
    if reach == _LOCAL and not bulk:
        environment[PROFILE], environment[REACH] = udp, _BY_PROFILE
    else:
        environment[PROFILE] = shared


def carries_bulk() -> bool:
    """False in a process that has no shared memory for clouds and images."""
    return os.environ.get(PROFILE) != _profiles()[1]


@contextmanager
def shared_memory() -> Iterator[None]:
    """A context that is initialised here has shared memory to receive from, whatever the process has."""
    before = os.environ[REACH]
    os.environ[REACH] = _LOCAL
    try:
        yield
    finally:
        os.environ[REACH] = before


def _profiles() -> tuple[str, str]:
    folder = config_dir()
    return str(folder / "fastdds.xml"), str(folder / "fastdds_udp.xml")

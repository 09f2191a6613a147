"""The DDS settings of every process of the stack, in force before rclpy starts unless somebody has chosen others.

- Everything stays on this machine: sockets are bound to the loopback interface, so nobody on the network moves the
  robot, whatever peers they name. Who chooses another discovery range gets sockets on every interface.
- Processes talk by UDP. Fast DDS's shared memory is for those alone that exchange clouds and images (``bulk``):
  whenever a participant with shared memory comes up, every other one checks its ports one by one, 0.33 s each where
  the port is idle, and holds the lock without which it sends nothing (Fast DDS issue 6535). The chain that stops the
  wheels must not stand still because somebody started a process.
- By UDP, and with Fast DDS's own shared-memory segment of 512 KiB, most point clouds (2.4 MB) are lost; the profile
  ``config/fastdds.xml`` has room for them.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager
from typing import NamedTuple

from robot_stack.core.config import config_dir

PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"
REACH = "ROS_AUTOMATIC_DISCOVERY_RANGE"
# malloc.h
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_KEPT_BYTES = 32 * 2**20  # glibc's own limit of the threshold
_LOCAL, _BY_PROFILE = "LOCALHOST", "SYSTEM_DEFAULT"


def apply(environment: MutableMapping[str, str] = os.environ, *, bulk: bool = False) -> None:
    """Sets what nobody has chosen. Raises ConfigError without a configuration folder.

    bulk: this process sends or takes clouds or images.
    """
    own = _profiles()
    if environment.get(PROFILE) in own:  # what a parent process has chosen for itself
        del environment[PROFILE]
        environment[REACH] = _LOCAL if environment[REACH] == _BY_PROFILE else environment[REACH]
    reach = environment.setdefault(REACH, _LOCAL)
    if PROFILE in environment:
        return
    # rmw adds transports of its own to every participant that it keeps on this machine: here the profile keeps it.
    if reach == _LOCAL:
        environment[PROFILE], environment[REACH] = own.shared if bulk else own.udp, _BY_PROFILE
    else:
        environment[PROFILE] = own.network


def keep_memory() -> None:
    """The C library keeps what clouds and images lay in for the next ones, in the process that asks for it.

    By default it gives each block of more than 128 KiB back to the kernel, and the next message's memory is new: it is
    zeroed page by page, some thousand page faults a second.
    """
    libc = ctypes.CDLL(None)
    if hasattr(libc, "mallopt"):  # glibc
        libc.mallopt(_M_MMAP_THRESHOLD, _KEPT_BYTES)
        libc.mallopt(_M_TRIM_THRESHOLD, _KEPT_BYTES)


def carries_bulk() -> bool:
    """False in a process that has no shared memory for clouds and images."""
    return os.environ.get(PROFILE) != _profiles().udp


@contextmanager
def shared_memory() -> Iterator[None]:
    """A context that is initialised here has shared memory to receive from, whatever the process has."""
    before = os.environ[REACH]
    os.environ[REACH] = _LOCAL
    try:
        yield
    finally:
        os.environ[REACH] = before


class _Profiles(NamedTuple):
    """Files: with shared memory, without, and for who talks beyond this machine."""

    shared: str
    udp: str
    network: str


def _profiles() -> _Profiles:
    return _Profiles(*(str(config_dir() / f"{name}.xml") for name in ("fastdds", "fastdds_udp", "fastdds_network")))

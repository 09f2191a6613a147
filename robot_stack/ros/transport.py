"""The DDS settings of every process of the stack, applied before rclpy starts unless the environment has others.

- Everything stays on this machine: sockets are bound to the loopback interface, so that no other computer can move the
  robot, whatever peers it names. Another discovery range gives sockets on every interface.
- Processes use UDP. Fast DDS's shared memory is only for processes that exchange clouds and images (``bulk``):
  whenever a participant with shared memory starts, every other one checks its ports one by one, 0.33 s each where
  the port is idle, and holds the lock without which it sends nothing (Fast DDS issue 6535). The chain that stops the
  wheels must not stand still because a process starts.
- By UDP, and with Fast DDS's own shared-memory segment of 512 KiB, most point clouds (2.4 MB) are lost; the profiles
  for ``bulk`` have room for them.
- A slow link to another computer holds no process without clouds: what does not fit is dropped. Clouds and images
  arrive there only if their sender waits for the link.
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
    """Sets the values that the environment does not. Raises ConfigError without a configuration folder.

    bulk: this process publishes or subscribes to clouds or images.
    """
    own = _profiles()
    if environment.get(PROFILE) in own:  # set by a parent process for itself
        del environment[PROFILE]
        environment[REACH] = _LOCAL if environment[REACH] == _BY_PROFILE else environment[REACH]
    reach = environment.setdefault(REACH, _LOCAL)
    if PROFILE in environment:
        return
    # rmw adds its own transports to every participant limited to this machine, so the profile sets that limit instead.
    if reach == _LOCAL:
        environment[PROFILE], environment[REACH] = own.shared if bulk else own.udp, _BY_PROFILE
    else:
        environment[PROFILE] = own.network if bulk else own.network_udp


def keep_memory() -> None:
    """Makes the C library keep the memory of clouds and images for the next ones, in the calling process.

    By default it returns each block of more than 128 KiB to the kernel, and the next message's memory is new: it is
    zeroed page by page, some thousand page faults a second.
    """
    libc = ctypes.CDLL(None)
    if hasattr(libc, "mallopt"):  # glibc
        libc.mallopt(_M_MMAP_THRESHOLD, _KEPT_BYTES)
        libc.mallopt(_M_TRIM_THRESHOLD, _KEPT_BYTES)


def carries_bulk() -> bool:
    """False in a process that has no shared memory for clouds and images."""
    return os.environ.get(PROFILE) not in (_profiles().udp, _profiles().network_udp)


@contextmanager
def shared_memory() -> Iterator[None]:
    """A context initialised inside has shared memory for receiving from this machine, whatever the process uses."""
    before = os.environ[REACH]
    os.environ[REACH] = _LOCAL
    try:
        yield
    finally:
        os.environ[REACH] = before


class _Profiles(NamedTuple):
    """Profile files: with shared memory, without, and both for communication beyond this machine."""

    shared: str
    udp: str
    network: str
    network_udp: str


def _profiles() -> _Profiles:
    names = ("fastdds", "fastdds_udp", "fastdds_network", "fastdds_network_udp")
    return _Profiles(*(str(config_dir() / f"{name}.xml") for name in names))

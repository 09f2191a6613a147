"""Another computer: a network namespace with a virtual cable to this machine. Needs root and iproute2."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

HERE, THERE = "198.51.100.1", "198.51.100.2"  # RFC 5737: documentation


class OtherHost(NamedTuple):
    """name: of the namespace. cable: the device of the cable's end on this machine."""

    name: str
    cable: str


@contextmanager
def other_host(shaping: Sequence[str] = ()) -> Iterator[OtherHost]:
    """shaping: a queueing discipline of tc for each end of the cable. Raises CalledProcessError, FileNotFoundError."""
    number = os.getpid()
    name, here, there = f"host{number}", f"oh{number}a", f"oh{number}b"

    def run(*words: str) -> None:
        subprocess.run(words, check=True, capture_output=True)

    run("ip", "netns", "add", name)
    try:
        run("ip", "link", "add", here, "type", "veth", "peer", "name", there, "netns", name)
        for inside, device, address in (((), here, HERE), (("-n", name), there, THERE)):
            run("ip", *inside, "address", "add", f"{address}/24", "dev", device)
            run("ip", *inside, "link", "set", device, "up")
            if shaping:
                run("tc", *inside, "qdisc", "add", "dev", device, "root", *shaping)
        run("ip", "-n", name, "link", "set", "lo", "up")
        yield OtherHost(name, here)
    finally:
        run("ip", "netns", "delete", name)  # deletes the cable too

"""Another computer: a network namespace with a virtual cable to this machine. Needs root and iproute2."""

from __future__ import annotations

import itertools
import os
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

_NETWORK = "198.51.100"  # RFC 5737: documentation
_numbers = itertools.count()  # several may exist at a time


class OtherHost(NamedTuple):
    """name: of the namespace. cable, address: the device of the cable's end on this machine, and its address."""

    name: str
    cable: str
    address: str


@contextmanager
def other_host(shaping: Sequence[str] = ()) -> Iterator[OtherHost]:
    """shaping: a queueing discipline of tc for each end of the cable. Raises CalledProcessError, FileNotFoundError."""
    count = next(_numbers)
    number = f"{os.getpid()}_{count}"
    name, here, there = f"host{number}", f"oh{number}a", f"oh{number}b"
    first = 4 * (count % 64)

    def run(*words: str) -> None:
        subprocess.run(words, check=True, capture_output=True)

    run("ip", "netns", "add", name)
    try:
        run("ip", "link", "add", here, "type", "veth", "peer", "name", there, "netns", name)
        for inside, device, address in (((), here, first + 1), (("-n", name), there, first + 2)):
            run("ip", *inside, "address", "add", f"{_NETWORK}.{address}/30", "dev", device)
            run("ip", *inside, "link", "set", device, "up")
            if shaping:
                run("tc", *inside, "qdisc", "add", "dev", device, "root", *shaping)
        run("ip", "-n", name, "link", "set", "lo", "up")
        yield OtherHost(name, here, f"{_NETWORK}.{first + 1}")
    finally:
        run("ip", "netns", "delete", name)  # deletes the cable too

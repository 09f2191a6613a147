"""A ROS domain for each test, held by a lock so that parallel test runs never share one."""

from __future__ import annotations

import fcntl
import os
import random
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# Domain ids up to 101 keep their UDP ports below Linux's ephemeral range.
_DOMAINS = range(20, 102)


@contextmanager
def held_domain() -> Iterator[int]:
    """A domain id that no other test of this machine holds."""
    folder = Path(tempfile.gettempdir()) / f"robot_stack_test_domains-{os.getuid()}"
    folder.mkdir(exist_ok=True)
    for domain in random.sample(_DOMAINS, len(_DOMAINS)):
        with open(folder / str(domain), "w", encoding="ascii") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            yield domain
            return
    raise RuntimeError("every test domain is in use")

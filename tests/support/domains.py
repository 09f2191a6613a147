"""A separate ROS domain for each test, locked so that parallel test runs never share one."""

from __future__ import annotations

import contextlib
import fcntl
import random
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

# Domain ids up to 101 keep their UDP ports below Linux's ephemeral range.
_DOMAINS = range(20, 102)


@contextmanager
def held_domain() -> Iterator[int]:
    """A domain id that no other test of this machine uses."""
    folder = Path(tempfile.gettempdir()) / "robot_stack_test_domains"
    with contextlib.suppress(FileExistsError):
        folder.mkdir()
        folder.chmod(0o1777)  # all users of the machine share the domains
    for domain in random.SystemRandom().sample(_DOMAINS, len(_DOMAINS)):
        with _opened(folder / str(domain)) as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            yield domain
            return
    raise RuntimeError("every test domain is in use")


def _opened(path: Path) -> IO[bytes]:
    """Opens a lock file read-only, because another user may have created it."""
    with contextlib.suppress(FileExistsError):
        path.touch(0o644, exist_ok=False)
    return path.open("rb")

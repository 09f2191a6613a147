"""Removes shared memory of killed processes.

Fast DDS keeps a segment (35 MB with this stack's transport profile) in /dev/shm for each process that exchanges clouds
or images, and deletes it when the process ends in order. A killed process cannot; with restarts that would fill the
memory. Beside each segment lies a file ``<segment>_el`` that its owner keeps locked while it lives, which
identifies dead owners.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import time
from pathlib import Path

_LOCK_FILE = re.compile(r"fastrtps_[0-9a-f]{16}_el")
# A process that is just starting creates its file a moment before it locks it.
_YOUNG_S = 5.0


def remove_dead(folder: Path = Path("/dev/shm"), young_s: float = _YOUNG_S) -> int:
    """Deletes this user's segments whose owners are dead. Returns their number."""
    return sum(_remove(path) for path in _lock_files(folder) if _is_dead(path, young_s))


def _lock_files(folder: Path) -> list[Path]:
    with contextlib.suppress(OSError):
        return [path for path in folder.iterdir() if _LOCK_FILE.fullmatch(path.name)]
    return []


def _is_dead(path: Path, young_s: float) -> bool:
    try:
        with open(path, "rb") as file:
            status = os.fstat(file.fileno())
            if status.st_uid != os.getuid() or time.time() - status.st_mtime < young_s:
                return False
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _remove(lock_file: Path) -> bool:
    with contextlib.suppress(FileNotFoundError):
        lock_file.with_name(lock_file.name.removesuffix("_el")).unlink()
    with contextlib.suppress(FileNotFoundError):
        lock_file.unlink()
    return True

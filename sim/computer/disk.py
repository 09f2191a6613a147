"""The monitored file system: the machine's own, or temporarily a small full one."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

# In a mount namespace of its own, which needs no rights; it lives as long as the pipe into `cat` is open.
_KEEP_FULL = 'mount -t tmpfs -o "size=$1" disk "$2" && { cat /dev/zero >"$2/filler"; echo full; exec cat; }'
_END_S = 5.0


class NoNamespaces(Exception):
    """An ordinary user cannot mount anything on this machine."""


class Disk:
    """path: a link to a folder of the monitored file system. home: a folder of the machine's own.

    mount_point: a folder for the small one. size_bytes: of the small one.
    """

    def __init__(self, path: Path, home: Path, mount_point: Path, size_bytes: int) -> None:
        self._path, self._mount_point, self._size_bytes = path, mount_point, size_bytes
        self._home = home
        self._keeper: subprocess.Popen[bytes] | None = None
        mount_point.mkdir(parents=True, exist_ok=True)
        self._point_to(home)

    def fill(self) -> None:
        """Raises NoNamespaces."""
        if self._keeper is not None:
            return
        command = ["sh", "-c", _KEEP_FULL, "sh", str(self._size_bytes), str(self._mount_point)]
        keeper = subprocess.Popen(
            ["unshare", "--map-root-user", "--mount", *command],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        assert keeper.stdout is not None
        if keeper.stdout.readline() != b"full\n":
            _end(keeper)
            raise NoNamespaces("this machine allows no user namespaces: nowhere to mount a disk that is full")
        self._keeper = keeper
        # Seen through the process that lives in the namespace.
        self._point_to(Path(f"/proc/{keeper.pid}/root") / self._mount_point.relative_to("/"))

    def empty(self) -> None:
        """Switches back to the machine's own file system."""
        self._point_to(self._home)
        if self._keeper is not None:
            _end(self._keeper)
            self._keeper = None

    def close(self) -> None:
        self.empty()
        self._path.unlink(missing_ok=True)

    def _point_to(self, target: Path) -> None:
        """Replaces the link atomically: a reader sees the old or the new one."""
        beside = self._path.with_name(f".{self._path.name}.new")
        beside.unlink(missing_ok=True)
        beside.symlink_to(target)
        os.replace(beside, self._path)


def _end(keeper: subprocess.Popen[bytes]) -> None:
    """Ends the process by closing the pipe, and with it the mount."""
    for pipe in (keeper.stdin, keeper.stdout):
        if pipe is not None:
            pipe.close()
    try:
        keeper.wait(_END_S)
    except subprocess.TimeoutExpired:
        keeper.kill()
        keeper.wait()

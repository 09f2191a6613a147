"""The runtime folder: locks, sockets, shared memory and logs of one running stack.

One folder for each user and ROS domain, so that stacks in different domains do not interfere. It lies in memory
(``/dev/shm``): its content is worth nothing after a reboot, and the shared status page must never wait for a disk.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import IO

from robot_stack.core.errors import ConfigError

_TOUCH_SCREEN = "touch_ui.url"


class AlreadyRunning(Exception):
    """Another process holds the lock of this name."""


def ros_domain_id() -> int:
    """The ROS domain in force. Raises ConfigError if ROS_DOMAIN_ID is no number in 0..232."""
    text = os.environ.get("ROS_DOMAIN_ID", "0") or "0"
    if not text.isdigit() or int(text) > 232:
        raise ConfigError(f"ROS_DOMAIN_ID must be a number in 0..232, is {text!r}")
    return int(text)


def runtime_dir() -> Path:
    """The folder of this user and domain, made if it is missing. ``ROBOT_STACK_RUNTIME_DIR`` overrides it.

    Raises ConfigError for a folder into which another user may write, or that cannot be made.
    """
    named = os.environ.get("ROBOT_STACK_RUNTIME_DIR")
    if named:
        folder = Path(named)
        _make(folder)
    else:
        of_user = _shared_memory() / f"robot_stack-{os.getuid()}"
        _make(of_user)
        _require_own(of_user)
        folder = of_user / f"domain-{ros_domain_id()}"
        _make(folder)
    _require_own(folder.resolve() if named else folder)
    return folder


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as error:
        raise ConfigError(f"runtime folder {folder} cannot be made: {error.strerror or error}") from None


def only_own(status: os.stat_result) -> bool:
    """No other user but root owns the file or may write to it."""
    return status.st_uid in (0, os.geteuid()) and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _require_own(folder: Path) -> None:
    """Rejects a folder of another user, which could hold a forged latch: any user may create files in shared memory."""
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or not only_own(status):
        raise ConfigError(f"{folder} belongs to another user or may be written by others: remove it and start again")


def state_home(environment: Mapping[str, str] = os.environ) -> Path:
    """The folder for what outlives a reboot: a service's ``$STATE_DIRECTORY``, else the user's
    ``$XDG_STATE_HOME/robot_stack``, else in ``~/.local/state``.
    """
    of_service = environment.get("STATE_DIRECTORY", "").split(":")[0]
    if of_service:
        return Path(of_service)
    home = environment.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    return Path(home) / "robot_stack"


def state_dir(environment: Mapping[str, str] = os.environ) -> Path:
    """The part of :func:`state_home` that belongs to this ROS domain. It need not exist yet."""
    return state_home(environment) / f"domain-{ros_domain_id()}"


def state_shadow_dir(environment: Mapping[str, str] = os.environ) -> Path:
    """A folder in memory for copies of what is in :func:`state_dir`. It need not exist yet.

    Each state folder has its own: a stack with another state folder must not read these copies.
    """
    name = hashlib.sha256(str(state_dir(environment).absolute()).encode()).hexdigest()[:16]
    return runtime_dir() / "state" / name


def environment_with_home(folder: Path, base: Mapping[str, str] = os.environ) -> dict[str, str]:
    """``base`` with the state and the data of a process below ``folder`` instead of the user's."""
    kept = {name: value for name, value in base.items() if name != "STATE_DIRECTORY"}
    home = folder.absolute()
    return {**kept, "XDG_STATE_HOME": str(home / "state"), "XDG_DATA_HOME": str(home / "data")}


def recordings_dir(chosen: str = "") -> Path:
    """The recordings folder: the configured one, else ``recordings`` in :func:`data_home`."""
    if chosen:
        return Path(chosen).expanduser().absolute()
    return data_home() / "recordings"


def own_missions_dir(environment: Mapping[str, str] = os.environ) -> Path:
    """The folder of missions made on this robot; those in ``config/`` come with the software."""
    return data_home(environment) / "missions"


def data_home(environment: Mapping[str, str] = os.environ) -> Path:
    """The user's folder for what people keep: ``$XDG_DATA_HOME/robot_stack``, else in ``~/.local/share``."""
    home = environment.get("XDG_DATA_HOME") or str(Path.home() / ".local" / "share")
    return Path(home) / "robot_stack"


def _shared_memory() -> Path:
    memory = Path("/dev/shm")
    return memory if os.access(memory, os.W_OK) else Path("/tmp")


def tell_touch_screen(url: str | None) -> None:
    """Publishes the URL of the touch screen's page in the runtime folder; None removes it."""
    path = runtime_dir() / _TOUCH_SCREEN
    if url is None:
        path.unlink(missing_ok=True)
    else:
        path.write_text(url, encoding="ascii")


def touch_screen_url() -> str | None:
    """URL of the touch screen's page; None if it is not served or not published yet."""
    try:
        return (runtime_dir() / _TOUCH_SCREEN).read_text(encoding="ascii")
    except OSError:
        return None


def lock_path(name: str) -> Path:
    """The file of a lock. It holds the process id of the last holder."""
    return runtime_dir() / "locks" / f"{name}.lock"


def hold_lock(name: str) -> IO[str]:
    """Takes the lock ``<name>.lock`` of the runtime folder. It is released when the process ends, in any way.

    Returns the open file, whose lifetime is the lock's. Raises AlreadyRunning with the holder's process id.
    """
    path = lock_path(name)
    path.parent.mkdir(exist_ok=True)
    file = open(path, "a+", encoding="ascii")  # noqa: SIM115 - the lock must outlive this function
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        file.seek(0)
        holder = file.read().strip() or "unknown"
        file.close()
        raise AlreadyRunning(f"{name} is already running in this ROS domain (process {holder})") from error
    file.seek(0)
    file.truncate()
    file.write(str(os.getpid()))
    file.flush()
    return file

"""The runtime folder and its locks."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from robot_stack.core import runtime
from robot_stack.core.config import ConfigError
from robot_stack.core.runtime import (
    AlreadyRunning,
    environment_with_home,
    hold_lock,
    lock_path,
    only_own,
    own_missions_dir,
    recordings_dir,
    ros_domain_id,
    runtime_dir,
    state_dir,
    state_home,
    state_shadow_dir,
)


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(tmp_path / "runtime"))


def test_lock_is_exclusive_and_names_its_holder() -> None:
    with hold_lock("node"):
        assert lock_path("node").read_text(encoding="ascii") == str(os.getpid())
        with pytest.raises(AlreadyRunning, match=f"node is already running in this ROS domain .process {os.getpid()}."):
            hold_lock("node")
        hold_lock("other").close()
    hold_lock("node").close()


def test_lock_dies_with_its_process() -> None:
    script = (
        "import os, signal; from robot_stack.core.runtime import hold_lock\n"
        "lock = hold_lock('node'); os.kill(os.getpid(), signal.SIGKILL)"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == -9
    hold_lock("node").close()


def test_folder_by_user_and_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROBOT_STACK_RUNTIME_DIR")
    monkeypatch.setenv("ROS_DOMAIN_ID", "232")
    folder = runtime_dir()
    assert folder.name == "domain-232"
    assert str(os.getuid()) in folder.parent.name
    folder.rmdir()


@pytest.mark.parametrize("mode", [0o770, 0o707])
@pytest.mark.parametrize("named", [True, False])
def test_a_folder_that_another_user_may_write_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, named: bool, mode: int
) -> None:
    monkeypatch.setattr(runtime, "_shared_memory", lambda: tmp_path)
    if not named:
        monkeypatch.delenv("ROBOT_STACK_RUNTIME_DIR")
    folder = runtime_dir()
    assert runtime_dir() == folder
    for writable in (folder,) if named else (folder, folder.parent):
        writable.chmod(mode)
        with pytest.raises(ConfigError, match=f"^{writable} belongs to another user or may be written by others"):
            runtime_dir()
        writable.chmod(0o700)
    monkeypatch.setattr(runtime, "only_own", lambda status: only_own(os.stat_result((*status[:4], 4711, *status[5:]))))
    with pytest.raises(ConfigError, match="belongs to another user"):
        runtime_dir()


@pytest.mark.parametrize("named", [True, False])
def test_a_runtime_folder_that_cannot_be_made_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, named: bool
) -> None:
    file = tmp_path / "file"
    file.touch()
    monkeypatch.setattr(runtime, "_shared_memory", lambda: file)
    monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(file / "folder") if named else "")
    with pytest.raises(ConfigError, match=f"^runtime folder {file}/.* cannot be made: Not a directory$"):
        runtime_dir()


def test_runtime_folder_rejects_symbolic_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROBOT_STACK_RUNTIME_DIR")
    monkeypatch.setattr(runtime, "_shared_memory", lambda: tmp_path)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir(mode=0o700)
    (tmp_path / f"robot_stack-{os.getuid()}").symlink_to(elsewhere)
    with pytest.raises(ConfigError, match="belongs to another user"):
        runtime_dir()


@pytest.mark.parametrize("text", ["-1", "233", "one", "1.5"])
def test_bad_domain(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(ConfigError, match="ROS_DOMAIN_ID must be a number"):
        ros_domain_id()


def test_recordings_go_to_the_chosen_folder_or_to_the_users_data(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert recordings_dir("rides") == tmp_path / "rides"
    assert recordings_dir("~/rides") == tmp_path / "home" / "rides"
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    assert recordings_dir() == tmp_path / "data" / "robot_stack" / "recordings"
    monkeypatch.delenv("XDG_DATA_HOME")
    assert recordings_dir() == tmp_path / "home" / ".local" / "share" / "robot_stack" / "recordings"


def test_a_home_holds_state_and_data_whatever_the_user_or_a_service_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", "/var/lib/robot_stack")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "user"))
    home = environment_with_home(tmp_path / "home")
    assert home["PATH"] == os.environ["PATH"]
    assert state_home() == Path("/var/lib/robot_stack")
    assert state_home(home) == tmp_path / "home" / "state" / "robot_stack"
    assert state_dir(home).parent == state_home(home)
    assert own_missions_dir(home) == tmp_path / "home" / "data" / "robot_stack" / "missions"


def test_each_state_folder_has_its_own_shadow_in_memory(tmp_path: Path) -> None:
    first, second = (environment_with_home(tmp_path / name) for name in ("first", "second"))
    assert state_shadow_dir(first) == state_shadow_dir(first)
    assert len({state_shadow_dir(), state_shadow_dir(first), state_shadow_dir(second)}) == 3
    assert state_shadow_dir(first).is_relative_to(runtime_dir())

"""The files of a run: parameters of its processes, logs, and what a full disk changes."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from datetime import datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from rclpy.parameter import parameter_dict_from_yaml_file, parameter_value_to_python

from robot_stack.contract.processes import PROCESSES
from robot_stack.core.runtime import runtime_dir
from robot_stack.supervisor import supervisor
from robot_stack.supervisor.fleet import _arguments, ros_value
from robot_stack.supervisor.logs import new_run


@pytest.mark.parametrize(
    ("value", "written"),
    [
        ([0, 1.5, 0], [0.0, 1.5, 0.0]),
        ([0, 1], [0, 1]),
        (["a", "b"], ["a", "b"]),
        ([True, False], [True, False]),
        (3, 3),
        ("x", "x"),
    ],
)
def test_values_are_written_so_that_ros_reads_them(value: Any, written: Any, tmp_path: Path) -> None:
    assert ros_value(value) == written
    path = tmp_path / "parameters.yaml"
    path.write_text(yaml.safe_dump({"node": {"ros__parameters": {"name": ros_value(value)}}}))
    read = parameter_dict_from_yaml_file(str(path), target_nodes=["node"])
    assert parameter_value_to_python(read["name"].value) == written


def test_overrides_are_in_memory_where_a_restart_finds_them(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(tmp_path))
    process = next(process for process in PROCESSES if process.name == "safety_monitor")
    assert "--params-file" not in _arguments(process, {"system_monitor": {"use_sim_time": True}})
    *_, option, file = _arguments(process, {"safety_monitor": {"use_sim_time": True}})
    assert (option, Path(file).parent) == ("--params-file", runtime_dir())
    assert yaml.safe_load(Path(file).read_text()) == {"safety_monitor": {"ros__parameters": {"use_sim_time": True}}}


def test_a_run_without_space_has_no_logs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def refused(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(Path, "mkdir", refused)
    number = errno.ENOSPC
    assert new_run(tmp_path, 0, datetime(2026, 1, 1), 3) == Path(os.devnull)
    number = errno.EACCES
    with pytest.raises(PermissionError):
        new_run(tmp_path, 0, datetime(2026, 1, 1), 3)


def test_supervisor_survives_a_log_on_a_full_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: str) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(sys, "stderr", SimpleNamespace(write=refuse, flush=lambda: None))
    supervisor._log("a process has ended")


_ORPHAN = """
import os, signal, sys, threading
from pathlib import Path
from types import SimpleNamespace
from robot_stack.supervisor import child
out, ended, received = os.dup(1), threading.Event(), []
signal.signal(signal.SIGINT, lambda *_: received.append("SIGINT"))
reader, writer = os.pipe()
os.close(writer)
child.parent_process = lambda: SimpleNamespace(sentinel=reader)
child.write_to(Path(sys.argv[1]))
child.time = SimpleNamespace(sleep=lambda _: ended.set())
os.killpg = lambda *_: None
threading.Thread(target=child._follow_the_supervisor, args=(threading.Event(), 50.0), daemon=True).start()
ended.wait(60.0)
os.write(out, f"{received} {signal.alarm(0) > 0}".encode())
os._exit(0)
"""


@pytest.mark.parametrize("log", ["/dev/full", "/dev/null/missing"])
def test_process_ends_after_its_supervisor_also_without_a_log(log: str) -> None:
    """Under a supervisor that has died it could be neither stopped nor restarted."""
    done = subprocess.run([sys.executable, "-c", _ORPHAN, log], capture_output=True, text=True, check=True)
    assert done.stdout == "['SIGINT'] True"

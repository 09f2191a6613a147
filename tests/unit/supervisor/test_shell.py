"""Logs, control socket and leftovers: the supervisor's effects on the machine."""

from __future__ import annotations

import fcntl
import json
import os
import selectors
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import psutil
import pytest

from robot_stack.core import runtime
from robot_stack.supervisor import logs, orphans, segments
from robot_stack.supervisor.control import ControlServer, NotRunning, Reply, ask, socket_path

NOON = datetime(2026, 1, 2, 12, 0, 0)


@pytest.fixture
def runtime_dir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(tmp_path / "runtime"))
    return runtime.runtime_dir()


class TestLogs:
    def test_two_runs_in_one_second(self, tmp_path: Path) -> None:
        first, second = (logs.new_run(tmp_path, 7, NOON, keep_runs=3) for _ in range(2))
        assert first.name == "20260102-120000-domain-7" != second.name
        assert (tmp_path / "latest").resolve() == second

    def test_old_runs_go_and_nothing_else(self, tmp_path: Path) -> None:
        (tmp_path / "notes").mkdir()
        runs = [logs.new_run(tmp_path, 1, NOON.replace(minute=minute), keep_runs=2) for minute in range(4)]
        assert [run.exists() for run in runs] == [False, False, True, True]
        assert (tmp_path / "notes").is_dir()

    def test_tail(self, tmp_path: Path) -> None:
        log = tmp_path / "a.log"
        log.write_text("1\n2\n3\n", encoding="utf-8")
        assert logs.tail(log, 2) == "2\n3"
        assert logs.tail(tmp_path / "none") == ""


@pytest.fixture
def server(runtime_dir: Path) -> Iterator[list[dict[str, Any]]]:
    """A control server in its own thread: it answers status with 1 and never answers ``down``."""
    asked: list[dict[str, Any]] = []
    kept: list[Reply] = []
    selector = selectors.DefaultSelector()
    stop = threading.Event()

    def handle(request: dict[str, Any], reply: Reply) -> None:
        asked.append(request)
        reply({"answer": 1}) if request["verb"] == "status" else kept.append(reply)

    control = ControlServer(selector, handle)

    def serve() -> None:
        while not stop.is_set():
            for key, _ in selector.select(0.02):
                key.data()

    thread = threading.Thread(target=serve)
    thread.start()
    yield asked
    stop.set()
    thread.join()
    for reply in kept:
        reply({})
    control.close()


class TestControl:
    def test_question_and_answer(self, server: list[dict[str, Any]]) -> None:
        with socket.socket(socket.AF_UNIX) as silent:  # which does not block others
            silent.connect(str(socket_path()))
            assert ask("status", extra="x") == {"answer": 1}
        assert server == [{"verb": "status", "extra": "x"}]
        assert socket_path().stat().st_mode & 0o077 == 0

    def test_silence_times_out(self, server: list[dict[str, Any]]) -> None:
        with pytest.raises(TimeoutError):
            ask("down", timeout_s=0.2)

    @pytest.mark.parametrize("line", [b"nonsense\n", b"[1]\n", b"\xff\xfe\n"])
    def test_nonsense_is_refused_and_the_next_question_answered(self, server: list[Any], line: bytes) -> None:
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(str(socket_path()))
            connection.sendall(line)
            answer = json.loads(connection.makefile().readline())
        assert answer["ok"] is False
        assert "not a request" in answer["error"]
        assert ask("status") == {"answer": 1}

    def test_endless_request_is_cut_off(self, server: list[dict[str, Any]]) -> None:
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(5.0)
            connection.connect(str(socket_path()))
            with pytest.raises(OSError):  # noqa: PT011 - broken pipe or reset, depending on the kernel
                connection.sendall(b"x" * 10_000_000)
        assert ask("status") == {"answer": 1}

    def test_docking_without_a_server(self, runtime_dir: Path) -> None:
        with pytest.raises(NotRunning):
            ask("status")

    def test_socket_of_a_killed_server_is_replaced(self, runtime_dir: Path) -> None:
        with socket.socket(socket.AF_UNIX) as dead:
            dead.bind(str(socket_path()))
        selector = selectors.DefaultSelector()
        ControlServer(selector, lambda request, reply: None).close()
        assert not socket_path().exists()


@pytest.fixture
def sleeper() -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    yield process
    process.kill()
    process.wait()


class TestOrphans:
    def test_noted_process_is_found_and_ended(self, runtime_dir: Path, sleeper: subprocess.Popen[bytes]) -> None:
        orphans.record([sleeper.pid])
        found = orphans.find()
        assert [process.pid for process in found] == [sleeper.pid]
        assert orphans.end(found, patience_s=5.0) == [sleeper.pid]
        assert sleeper.poll() is not None
        assert orphans.find() == []
        orphans.record([os.getpid()])
        orphans.forget()
        assert orphans.find() == []

    def test_zombie_process_counts_as_ended(self, sleeper: subprocess.Popen[bytes]) -> None:
        process = psutil.Process(sleeper.pid)
        assert orphans.wait_ended([process], timeout_s=0.05) == [process]
        sleeper.kill()
        assert orphans.wait_ended([process], timeout_s=5.0) == []
        assert process.status() == psutil.STATUS_ZOMBIE

    def test_number_of_another_process_is_not_ours(self, runtime_dir: Path, sleeper: subprocess.Popen[bytes]) -> None:
        earlier_s = psutil.Process(sleeper.pid).create_time() - 100.0
        (runtime_dir / "processes.json").write_text(json.dumps({str(sleeper.pid): earlier_s}))
        assert orphans.find() == []

    @pytest.mark.parametrize("text", ["{", '{"x": 1}', '{"999999999": 1}'])
    def test_malformed_process_note_is_ignored(self, runtime_dir: Path, text: str) -> None:
        (runtime_dir / "processes.json").write_text(text)
        assert orphans.find() == []

    @pytest.mark.parametrize("kind", [socket.SOCK_STREAM, socket.SOCK_DGRAM, socket.SOCK_SEQPACKET])
    def test_dead_sockets_go_living_ones_stay(self, runtime_dir: Path, kind: socket.SocketKind) -> None:
        (runtime_dir / "deeper").mkdir()
        dead, alive, file = runtime_dir / "deeper" / "dead", runtime_dir / "alive", runtime_dir / "file"
        file.write_text("x")
        with socket.socket(socket.AF_UNIX, kind) as closed:
            closed.bind(str(dead))
        with socket.socket(socket.AF_UNIX, kind) as listening:
            listening.bind(str(alive))
            if kind is not socket.SOCK_DGRAM:
                listening.listen()
            assert orphans.remove_stale_sockets() == [dead]
        assert alive.exists()
        assert file.exists()


class TestSegments:
    NAME = "fastrtps_0123456789abcdef"

    def make(self, folder: Path) -> Path:
        (folder / self.NAME).write_bytes(b"x")
        lock = folder / f"{self.NAME}_el"
        lock.touch()
        return lock

    def test_segment_of_a_dead_process_goes(self, tmp_path: Path) -> None:
        self.make(tmp_path)
        (tmp_path / "fastrtps_port7411_el").touch()
        assert segments.remove_dead(tmp_path) == segments.remove_dead(tmp_path / "none") == 0  # young, and none
        assert segments.remove_dead(tmp_path, young_s=0.0) == 1
        assert [path.name for path in tmp_path.iterdir()] == ["fastrtps_port7411_el"]

    def test_segment_of_a_living_process_stays(self, tmp_path: Path) -> None:
        with open(self.make(tmp_path)) as owner:
            fcntl.flock(owner, fcntl.LOCK_EX)
            assert segments.remove_dead(tmp_path, young_s=0.0) == 0
        assert (tmp_path / self.NAME).exists()

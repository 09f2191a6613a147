"""The supervisor with real processes that crash, hang, refuse or are killed; no process remains."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest
import yaml
from std_msgs.msg import Bool

from robot_stack.contract import topics
from robot_stack.contract.faults import BY_CODE
from robot_stack.core.runtime import environment_with_home, runtime_dir, state_dir, state_shadow_dir
from robot_stack.safety.latch_store import COPIES, Record, decode, encode
from robot_stack.safety.monitor import Memory
from robot_stack.safety.nodes.safety_monitor import LATCH_FILE, LATCH_FOLDER
from robot_stack.supervisor.client import Launch, start
from robot_stack.supervisor.control import NotRunning, ask
from tests.support.command_line import Done, cli
from tests.support.fake_safety import FakeSafety
from tests.support.peer import Peer
from tests.support.processes import ROOT
from tests.support.waiting import wait_for

NAMES = ("steady", "other", "spare")
CRITICALITIES = ("critical", "limiting", "optional")


class Stack:
    """One supervised stack of three dummy processes, operated through the command line."""

    def __init__(self, folder: Path) -> None:
        self.orders = folder / "orders"
        self.orders.mkdir()
        self.slow_import = folder / "import"
        self.logs = folder / "logs"
        self.profile = folder / "dummies.yaml"
        self.write_profile()
        self.seen: set[int] = set()

    def write_profile(self, **changes: Any) -> None:
        extra = {
            name: {
                "module": "tests.support.supervised",
                "criticality": criticality,
                "note": "dummy",
                "max_restarts": 3,
            }
            for name, criticality in zip(NAMES, CRITICALITIES, strict=True)
        }
        data = {
            "description": "dummies",
            "machine": "robot",
            "use_sim_time": False,
            "speed": None,
            "ready_deadline_s": 30.0,
            "engine": None,
            "processes": [],
            "environment": {"SUPERVISED_ORDERS": str(self.orders)},
            "extra": extra,
        }
        self.profile.write_text(yaml.safe_dump({**data, **changes}, sort_keys=False), encoding="utf-8")

    def up(self, *arguments: str) -> Done:
        done = cli("up", "--profile", str(self.profile), "--log-dir", str(self.logs), *arguments)
        self.note()
        return done

    def note(self) -> None:
        """Stores the running processes to check later that they have ended."""
        try:
            status = ask("status")
        except NotRunning:
            return
        supervisor = psutil.Process(status["pid"])
        self.seen |= {supervisor.pid, *(child.pid for child in supervisor.children(recursive=True))}

    def order(self, name: str, word: str) -> None:
        (self.orders / name).write_text(word, encoding="ascii")

    def obey_no_more(self, name: str) -> None:
        (self.orders / name).unlink()

    def entry(self, name: str) -> dict[str, Any]:
        self.note()
        return next(item for item in ask("status")["processes"] if item["name"] == name)

    def wait_entry(
        self, name: str, condition: Callable[[dict[str, Any]], bool], what: str, deadline_s: float = 30.0
    ) -> dict[str, Any]:
        def matching() -> dict[str, Any] | None:
            entry = self.entry(name)
            return entry if condition(entry) else None

        found = wait_for(matching, f"{name}: {what}", deadline_s, poll_s=0.05)
        assert found is not None
        return found

    def log(self, name: str) -> str:
        return (self.logs / "latest" / f"{name}.log").read_text(encoding="utf-8")

    def alive(self) -> list[int]:
        return [pid for pid in self.seen if _alive(pid)]

    def clean_up(self) -> None:
        with contextlib.suppress(TimeoutError, psutil.Error):
            self.note()
        for pid in self.alive():
            os.kill(pid, signal.SIGCONT)
        cli("down")
        for pid in self.alive():
            os.kill(pid, signal.SIGKILL)


def _alive(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


@pytest.fixture
def stack(ros_domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Stack]:
    made = Stack(tmp_path)
    monkeypatch.setenv("SUPERVISED_IMPORT", str(made.slow_import))
    yield made
    made.clean_up()
    wait_for(lambda: not made.alive(), "every process to be gone", 10.0)


@pytest.fixture
def running(stack: Stack) -> Stack:
    done = stack.up()
    assert done.returncode == 0, done.stderr
    return stack


def assert_nothing_left(stack: Stack) -> None:
    wait_for(lambda: not stack.alive(), "every process to be gone", 10.0)
    assert [path for path in runtime_dir().rglob("*") if stat.S_ISSOCK(path.lstat().st_mode)] == []
    assert not (runtime_dir() / "processes.json").exists()


def test_up_returns_when_all_are_ready_and_down_leaves_nothing(running: Stack) -> None:
    """Also a process that ignores signals, and its child. Meanwhile: names, groups, urgency, shared memory and logs of
    the processes, and commands that change nothing."""
    done = cli("status", "--json")
    assert done.returncode == 0
    status = json.loads(done.stdout)
    assert status["ready"] is True
    assert {item["name"] for item in status["processes"]} == set(NAMES)
    for item in status["processes"]:
        assert (item["state"], item["restarts"]) == ("ready", 0)
        assert item["heartbeat_age_s"] >= 0.0
        assert item["pss_mb"] > 1.0
        assert 0.0 <= item["cpu_pct"] <= 100.0 * os.cpu_count()
        process = psutil.Process(item["pid"])
        assert process.cmdline()[0] == f"robot-stack: {item['name']}"
        assert process.name() == item["name"]
        assert os.getpgid(process.pid) == process.pid
        memory = process.memory_full_info()
        assert memory.pss < 0.75 * memory.rss  # forked from one server, so common imports are shared
    logs = {path.name for path in (running.logs / "latest").glob("*.log")}
    assert logs == {"supervisor.log", *(f"{name}.log" for name in NAMES)}
    assert "working" in running.log("steady")
    assert "all 3 processes are ready" in running.log("supervisor")
    pids = [status["pid"], *(running.entry(name)["pid"] for name in NAMES)]
    # Only root may make a process more urgent.
    urgency = [-15, -10, -10, 0] if os.getuid() == 0 else [0] * 4
    assert [os.getpriority(os.PRIO_PROCESS, pid) for pid in pids] == urgency
    for arguments, code, text in (
        (("restart", "nobody"), 2, "'nobody' does not run here; processes: steady, other, spare"),
        (("up", "--profile", str(running.profile)), 1, "already running in ROS domain"),
        (("up", "--profile", str(running.profile), "--set", "nobody.x=1"), 2, "'nobody' is no node of this profile"),
    ):
        done = cli(*arguments)
        assert (done.returncode, text in done.stderr) == (code, True), done.stderr
    assert [running.entry(item["name"])["pid"] for item in status["processes"]] == [
        item["pid"] for item in status["processes"]
    ]
    running.order("steady", "child")
    wait_for(lambda: psutil.Process(running.entry("steady")["pid"]).children(), "a child process")
    running.order("other", "stubborn")
    running.note()
    done = cli("down")
    assert done.returncode == 0
    assert done.stdout.strip() == "stopped 3 processes; had to be killed: other"
    assert_nothing_left(running)
    assert cli("down").stdout.startswith("no stack is running")


def test_up_reports_emergency_stop_latched_earlier_and_release_command(stack: Stack) -> None:
    state_shadow_dir().mkdir(parents=True)
    (state_shadow_dir() / LATCH_FILE).write_bytes(encode(Record(1, Memory(("ESTOP_PRESSED",), passenger=False))))
    stack.write_profile(processes=["safety_monitor"])
    done = stack.up("--set", "safety_monitor.expected_processes=[recorder]")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    begin = lines.index("safety: EMERGENCY_STOP: the robot does not move")
    assert lines[begin + 1] == f"  ESTOP_PRESSED: {BY_CODE['ESTOP_PRESSED'].raised_when} (latched)"
    assert "`robot-stack reset` releases it" in lines[-1]


def test_a_stack_with_a_home_of_its_own_neither_meets_nor_leaves_a_latched_stop(stack: Stack, tmp_path: Path) -> None:
    pressed = encode(Record(1, Memory(("ESTOP_PRESSED",), passenger=False)))
    user_files = [state_dir() / LATCH_FOLDER / name for name in COPIES] + [state_shadow_dir() / LATCH_FILE]
    for path in user_files:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(pressed)
    stack.write_profile(processes=["safety_monitor"])
    settings = ("safety_monitor.expected_processes=[recorder]",)
    home = tmp_path / "home"
    launch = Launch(str(stack.profile), settings, only=("safety_monitor",), log_dir=stack.logs, home=home)
    start(launch, 60.0)
    stack.note()
    own = state_dir(environment_with_home(home)) / LATCH_FOLDER / COPIES[0]
    wait_for(own.is_file, "the record of the stack's own state")
    cli("down")
    assert "ESTOP_PRESSED" not in decode(own.read_bytes()).memory.latched
    assert all(path.read_bytes() == pressed for path in user_files)


def test_killed_hung_and_stopped_processes_are_restarted_until_it_is_too_often(running: Stack) -> None:
    """A killed forkserver costs each a restart; requests are answered while its successor imports.

    The stopped one (SIGSTOP) is alive for the kernel, without heartbeats, and does not react to SIGTERM."""
    before = {name: running.entry(name)["pid"] for name in NAMES}
    os.kill(before["steady"], signal.SIGKILL)
    waiting = running.wait_entry("steady", lambda item: item["state"] == "backoff", "to wait for its restart")
    assert "signal 9" in waiting["reason"]
    running.wait_entry("steady", lambda item: item["state"] == "ready", "to be ready again")
    assert running.entry("other")["pid"] == before["other"]

    os.kill(before["other"], signal.SIGSTOP)
    running.order("spare", "hang")
    hung = running.wait_entry("spare", lambda item: item["state"] == "hung", "to be found hung")
    assert "no heartbeat for 3 s" in hung["reason"]
    running.obey_no_more("spare")
    after = {
        name: running.wait_entry(name, lambda item: item["state"] == "ready" and item["restarts"] == 1, "to be back")
        for name in NAMES
    }
    assert "SIGKILL" in running.log("supervisor")
    assert not any(map(_alive, before.values()))

    forkserver = psutil.Process(after["steady"]["pid"]).ppid()
    assert forkserver != ask("status")["pid"]
    running.slow_import.touch()
    os.kill(forkserver, signal.SIGKILL)
    for name in NAMES:
        running.wait_entry(name, lambda item: item["state"] == "backoff", "to wait for its restart")
    time.sleep(2.0)  # beyond the back-off
    assert {item["state"] for item in ask("status")["processes"]} == {"backoff"}
    running.slow_import.unlink()
    for name in NAMES:
        running.wait_entry(name, lambda item: item["state"] == "ready" and item["restarts"] == 2, "to be back again")
    assert not any(_alive(item["pid"]) for item in after.values())

    running.order("other", "crash")
    failed = running.wait_entry("other", lambda item: item["state"] == "failed", "to be given up")
    assert failed["restarts"] == 3
    assert failed["pid"] is None
    assert "the 4th time within 60 s" in failed["reason"]
    assert cli("status", "--once").returncode == 1
    running.obey_no_more("other")
    assert cli("restart", "other").returncode == 0
    running.wait_entry("other", lambda item: item["state"] == "ready", "to run again")


def test_up_reports_refusing_and_waiting_processes_and_stack_keeps_running(stack: Stack) -> None:
    stack.order("spare", "refuse")
    stack.order("other", "waiting")
    done = stack.up("--deadline", "5")
    assert done.returncode == 1
    # Before that, the progress of the start names every process.
    reasons = done.stderr.rpartition("error: ")[2]
    assert "spare: failed: given up: refused to run, see its log" in reasons
    assert "other: waiting: /sensors/imu" in reasons
    assert "steady" not in reasons
    assert stack.entry("spare")["restarts"] == 0
    stack.obey_no_more("other")
    stack.wait_entry("other", lambda item: item["state"] == "ready", "to become ready after all")


def test_interrupted_up_stops_what_it_started(stack: Stack) -> None:
    stack.write_profile(ready_deadline_s=600.0)
    stack.order("other", "waiting")
    command = [sys.executable, "-m", "robot_stack.cli", "up", "--profile", str(stack.profile)]
    waiting = subprocess.Popen(
        [*command, "--log-dir", str(stack.logs)],
        cwd=ROOT,
        stderr=subprocess.DEVNULL,
    )
    try:
        wait_for(_answers, "the supervisor to answer")
        stack.note()
        waiting.send_signal(signal.SIGINT)
        assert waiting.wait(60.0) != 0
    finally:
        waiting.kill()
        waiting.wait()
    assert_nothing_left(stack)


def _answers() -> bool:
    try:
        return bool(ask("status")["ok"])
    except (NotRunning, TimeoutError):
        return False


def test_killed_supervisor_takes_its_processes_along_and_the_next_ends_one_that_hangs(running: Stack) -> None:
    """Also a child of one, and one of which no thread can run, so that only the kernel can end it."""
    running.order("steady", "child")
    wait_for(lambda: psutil.Process(running.entry("steady")["pid"]).children(), "a child process")
    running.order("spare", "locked")
    running.note()
    os.kill(ask("status")["pid"], signal.SIGKILL)
    wait_for(lambda: not running.alive(), "every process to stop by itself", 10.0)
    assert "the supervisor has died" in running.log("steady")
    running.obey_no_more("spare")
    running.obey_no_more("steady")
    done = running.up()
    assert done.returncode == 0, done.stderr

    # A process that hangs while its supervisor dies cannot end by itself.
    pid = running.entry("other")["pid"]
    siblings = [running.entry(name)["pid"] for name in ("steady", "spare")]
    os.kill(pid, signal.SIGSTOP)
    os.kill(ask("status")["pid"], signal.SIGKILL)
    wait_for(lambda: not any(map(_alive, siblings)), "the others to end", 10.0)
    assert _alive(pid)
    done = running.up()
    assert done.returncode == 0, done.stderr
    assert not _alive(pid)
    assert f"earlier supervisor: {pid}" in running.log("supervisor")


def test_foreground_stops_on_sigterm(stack: Stack, tmp_path: Path) -> None:
    """systemd runs it this way."""
    log = tmp_path / "foreground.log"
    with open(log, "wb") as output:
        process = subprocess.Popen(
            [
                *(sys.executable, "-m", "robot_stack.cli", "up", "--foreground"),
                *("--profile", str(stack.profile), "--log-dir", str(stack.logs)),
            ],
            cwd=ROOT,
            stdout=output,
            stderr=output,
        )
    try:
        wait_for(lambda: "all 3 processes are ready" in log.read_text(), "the stack to be ready", 30.0)
        stack.note()
        assert ask("status")["pid"] == process.pid
        process.send_signal(signal.SIGTERM)
        assert process.wait(60.0) == 0
    finally:
        process.kill()
        process.wait()
    assert_nothing_left(stack)


def test_emergency_stop_and_reset_by_the_supervisor_and_past_it(running: Stack, peer: Peer) -> None:
    peer.listen(topics.EMERGENCY_STOP_SOURCES)  # as the safety monitor does: the tool waits for it
    safety = FakeSafety(peer)
    wait_for(lambda: ask("safety")["safety"], "the safety monitor to reach the supervisor")
    done = cli("estop")
    assert done.returncode == 0, done.stderr
    assert safety.active
    assert "estop requested" in running.log("supervisor")
    assert ask("status")["safety"]["state"] == "EMERGENCY_STOP"
    done = cli("reset")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "released: ESTOP_PRESSED\n"
    assert safety.requests == [True, False]
    safety.refusals = ["refused: the robot moves"] * 100
    done = cli("reset")
    assert done.returncode == 1
    assert done.stderr.startswith("error: refused: the robot moves; ")

    # After a release by others: the supervisor's latched true would stop a node that starts later.
    safety.requests.clear()
    cli("estop")
    peer.publish(topics.EMERGENCY_STOP, Bool(data=False))
    safety.active = False
    wait_for(lambda: safety.requests == [True, False, False], "the supervisor to follow", 10.0)

    # Unconfirmed: sent first by the supervisor, then by the command's own node.
    safety.requests.clear()
    safety.obeys = False
    done = cli("estop", "--timeout", "3")
    assert done.returncode == 1
    assert "use the button" in done.stderr
    wait_for(lambda: safety.requests.count(True) == 2, "both stops")

    # A supervisor that hangs neither prevents a stop nor the end of the stack.
    safety.obeys = True
    running.note()
    os.kill(ask("status")["pid"], signal.SIGSTOP)
    done = cli("estop")
    assert done.returncode == 0, done.stderr
    assert safety.active
    done = cli("down")
    assert done.returncode == 0, done.stderr
    assert_nothing_left(running)

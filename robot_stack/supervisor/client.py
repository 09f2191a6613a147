"""Starting, querying and stopping a supervisor from another process."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from robot_stack.core.runtime import environment_with_home, lock_path, ros_domain_id
from robot_stack.core.wheels_env import ros_environment
from robot_stack.supervisor import orphans, segments
from robot_stack.supervisor.control import NotRunning, ask
from robot_stack.supervisor.logs import default_log_dir
from robot_stack.supervisor.params import load_params

LOCK_NAME = "supervisor_process"
_POLL_S = 0.05
_ANSWER_S = 1.0  # timeout of one poll, so that an interruption takes effect
# Longest processor time of a supervisor and its forkserver until the first process, by far: more is an endless loop.
_START_PROCESSOR_S = 60.0
_STOP_MARGIN_S = 5.0  # added to the grace time of stopping processes


class StartError(Exception):
    """The stack did not become ready. The message names what is missing."""


@dataclass(frozen=True, slots=True)
class Launch:
    """The arguments of ``up``; see supervisor.profile.load_plan.

    home: the folder for the state and data of the stack (latched stop, journal, corrections, logs, missions,
    recordings); None for the user's own.
    """

    profile: str
    settings: Sequence[str] = ()
    only: Sequence[str] = ()
    speed: float | None = None
    log_dir: Path | None = None
    system_time: bool = False
    home: Path | None = None
    without: Sequence[str] = ()
    fleet: str | None = None

    def environment(self) -> dict[str, str]:
        """The supervisor's environment: with the ROS wheels on its paths, so that no process starts twice."""
        own = {**os.environ, **ros_environment()}
        return own if self.home is None else environment_with_home(self.home, own)

    def command(self, *options: str) -> list[str]:
        settings = [part for item in self.settings for part in ("--set", item)]
        only = [part for item in self.only for part in ("--only", item)]
        without = [part for item in self.without for part in ("--without", item)]
        speed = [] if self.speed is None else ["--speed", str(self.speed)]
        folder = ["--log-dir", str(self.log_dir or default_log_dir())]
        supervisor = [sys.executable, "-m", "robot_stack.supervisor", "--profile", self.profile]
        time_source = ["--system-time"] if self.system_time else []
        fleet = [] if self.fleet is None else ["--fleet", self.fleet]
        return [*supervisor, *settings, *only, *without, *fleet, *speed, *time_source, *folder, *options]


def refuse_second() -> None:
    """Raises StartError if this domain has a supervisor."""
    holder = _supervisor()
    if holder is None:
        return
    with contextlib.suppress(NotRunning, TimeoutError):
        status = ask("status")
        raise StartError(
            f"a stack is already running in ROS domain {status['domain']} (profile {status['profile']}, "
            f"process {status['pid']}); stop it with `robot-stack down` or choose another ROS_DOMAIN_ID"
        )
    raise StartError(
        f"the supervisor process {holder.pid} holds this ROS domain but does not answer: `robot-stack down`"
    )


def start(
    launch: Launch, deadline_s: float, progress: Callable[[dict[str, Any]], None] | None = None
) -> dict[str, Any]:
    """Starts a supervisor in the background and waits until every process is ready. Returns its status.

    The deadline counts from the end of all construction: compiling and loading may take any time. Until the first
    process is started, a supervisor that still gets processor time, or its forkserver, is starting, however slowly on a
    busy computer.

    Raises StartError if the domain has one already, if it ends, or if the deadline passes; then the start continues.
    If interrupted, it stops what it has started.
    """
    refuse_second()
    supervisor = subprocess.Popen(
        launch.command(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,  # no signal of this terminal reaches it
        env=launch.environment(),
        text=True,
    )
    try:
        with _interruption() as interrupted:
            status = _wait_ready(supervisor, deadline_s, progress, interrupted)
        if status is not None and not interrupted.is_set():
            return status
        signal.raise_signal(signal.SIGINT)  # to the caller's own handler
        raise KeyboardInterrupt
    except KeyboardInterrupt:  # an interrupted start is undone
        supervisor.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            supervisor.wait(load_params().terminate_s + _STOP_MARGIN_S)
        raise


@contextlib.contextmanager
def _interruption() -> Iterator[threading.Event]:
    """Ctrl-C as an event: the exception is lost where Python ignores exceptions, as while it closes a socket."""
    interrupted = threading.Event()
    before = signal.getsignal(signal.SIGINT)
    # The main thread alone gets signals; a shell that starts it in the background has Ctrl-C ignored.
    if threading.current_thread() is not threading.main_thread() or before in (signal.SIG_IGN, None):
        yield interrupted
        return
    signal.signal(signal.SIGINT, lambda _number, _frame: interrupted.set())
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, before)


def _wait_ready(
    supervisor: subprocess.Popen[str],
    deadline_s: float,
    progress: Callable[[dict[str, Any]], None] | None,
    interrupted: threading.Event,
) -> dict[str, Any] | None:
    """The status of a stack that is ready; None once ``interrupted`` is set."""
    assert supervisor.stderr is not None
    status: dict[str, Any] = {}
    computed_s = 0.0
    end_s = time.monotonic() + deadline_s
    while time.monotonic() < end_s:
        if supervisor.poll() is not None:
            message = supervisor.stderr.read().strip().removeprefix("error: ")
            raise StartError(message or f"the supervisor ended: {_last_words(status)}")
        if interrupted.is_set():
            return None
        with contextlib.suppress(NotRunning, TimeoutError):
            status = ask("status", timeout_s=_ANSWER_S)
            if progress is not None:
                progress(status)
            if status["ready"]:
                return status
            if any(item["state"] == "starting" for item in status["processes"]):
                end_s = time.monotonic() + deadline_s
            if all(item["state"] in ("ready", "failed") for item in status["processes"]):
                break  # nothing is left to wait for
        begun = any(item["pid"] is not None for item in status.get("processes", ()))
        if not begun and computed_s < (newest_s := _processor_s(supervisor.pid)) < _START_PROCESSOR_S:
            computed_s, end_s = newest_s, time.monotonic() + deadline_s
        time.sleep(_POLL_S)
    raise StartError(not_ready(status))


def _processor_s(pid: int) -> float:
    """Processor time of a process and its children, 0 if it has ended."""
    try:
        process = psutil.Process(pid)
        times = [item.cpu_times() for item in (process, *process.children())]
    except psutil.Error:
        return 0.0
    return float(sum(item.user + item.system for item in times))


def not_ready(status: dict[str, Any]) -> str:
    """Processes that are not ready, one line each, with the reason."""
    if not status:
        return "the supervisor does not answer"
    lines = [
        f"  {item['name']}: {item['state']}{': ' if item['reason'] else ''}{item['reason']}"
        for item in status["processes"]
        if item["state"] != "ready"
    ]
    nodeless = [f"  {status['without_node']}"] if status.get("without_node") else []
    return "\n".join(["not ready:", *lines, *nodeless, f"logs: {status['log_dir']}"])


def stop() -> dict[str, Any]:
    """Stops the stack of this domain. Returns the names of its processes as ``stopped`` and ``killed``.

    A supervisor that does not answer is killed and its processes are ended.
    Raises NotRunning if there is nothing to stop.
    """
    params = load_params()
    patience_s = params.terminate_s + _STOP_MARGIN_S
    supervisor = _supervisor()
    try:
        answer = ask("down", timeout_s=patience_s)
    except (NotRunning, TimeoutError):
        return _stop_by_force(supervisor, params.terminate_s)
    if supervisor is not None:
        orphans.wait_ended([supervisor], patience_s)
    return answer


def _stop_by_force(supervisor: psutil.Process | None, patience_s: float) -> dict[str, Any]:
    left = orphans.find()
    if supervisor is None and not left:
        raise NotRunning(f"no stack is running in ROS domain {ros_domain_id()}")
    if supervisor is not None:
        with contextlib.suppress(psutil.Error):
            supervisor.kill()
        orphans.wait_ended([supervisor], patience_s)
    ids = orphans.end(left, patience_s)
    orphans.forget()
    orphans.remove_stale_sockets()
    segments.remove_dead()
    return {"ok": True, "stopped": [], "killed": [f"process {pid}" for pid in ids]}


def _supervisor() -> psutil.Process | None:
    """The process that holds the supervisor's lock, if it lives."""
    path = lock_path(LOCK_NAME)
    with contextlib.suppress(OSError, ValueError, psutil.Error):
        process = psutil.Process(int(path.read_text(encoding="ascii")))
        # Process ids are reused: after a crash the id in the file may belong to another process.
        if "robot_stack.supervisor" in process.cmdline() and process.status() != psutil.STATUS_ZOMBIE:
            return process
    return None


def _last_words(status: dict[str, Any]) -> str:
    return f"see {status['log_dir']}/supervisor.log" if status else "before it could answer"

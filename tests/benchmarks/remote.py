"""What a viewer on another machine receives over a slow link, and what it costs the robot."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from robot_stack.contract import topics
from robot_stack.ros.transport import REACH
from robot_stack.supervisor.profile import load_plan
from robot_stack.system_monitor.topic_check import judge_all, rows_of, worst_rate_error
from tests.benchmarks.support.commands import robot_stack
from tests.benchmarks.support.framework import Aim, BenchError, Result
from tests.benchmarks.support.stack import running_stack
from tests.support.other_host import OtherHost, other_host

# /plan has no rate of its own: it is published when it changes.
VIEWED = (topics.CURRENT_POSE, *topics.REMOTE_COPIES, topics.PLAN)
AIMS = {
    "current_pose_hz": Aim(">=", 5.0),
    "points_hz": Aim(">=", 5.0),
    "front_camera_hz": Aim(">=", 5.0),
    "rear_camera_hz": Aim(">=", 5.0),
    "worst_rate_error_pct": Aim("<", 2.0),
}
_NAMES = ("current_pose_hz", "points_hz", "front_camera_hz", "rear_camera_hz", "plan_hz")
_VIEWER = [sys.executable, "-m", "tests.benchmarks.nodes.remote_viewer"]
_SETTLE_S = 10.0


def run(duration_s: float = 20.0, mbit: float = 20.0, profile: str = "sim", mission: str = "yard_tour") -> Result:
    """Rates, per simulated second, that a viewer receives in a network namespace behind a link of ``mbit`` each way.

    link_mbit: what the link carried to the viewer in that time, per second. worst_rate_error_pct,
    unviewed_rate_error_pct: of all topics of the robot, with and without the viewer. Raises BenchError without the
    rights for network namespaces.
    """
    from robot_stack.system_monitor.nodes.topic_meter import Meter

    os.environ[REACH] = "SUBNET"
    with _link(mbit) as viewer, running_stack(profile) as status, _remote_view():
        plan = load_plan(status["profile_path"], only=[item["name"] for item in status["processes"]])
        rows = rows_of(plan.machine, status["use_sim_time"])
        nodes = frozenset(node for process in plan.processes for node in process.nodes)
        with Meter(rows) as meter:
            meter.settle(_SETTLE_S)
            robot_stack("mission", "start", mission)
            meter.run(duration_s)
            unviewed = worst_rate_error(judge_all(rows, meter.seen(), nodes, 0.02))
            words = ["ip", "netns", "exec", viewer.name, *_VIEWER, str(_SETTLE_S), str(duration_s)]
            with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
                assert process.stdout is not None
                process.stdout.readline()  # ready
                before, begun_s = _sent_bytes(viewer.cable), time.monotonic()
                meter.run(duration_s)
                carried_mbit = 8e-6 * (_sent_bytes(viewer.cable) - before) / (time.monotonic() - begun_s)
                received = process.communicate()[0]
            viewed = worst_rate_error(judge_all(rows, meter.seen(), nodes, 0.02))
            robot_stack("mission", "abort", check=False)
    if process.returncode:
        raise BenchError("the viewer failed")
    rates: dict[str, float] = json.loads(received)
    figures = {name: rates[row.name] for name, row in zip(_NAMES, VIEWED, strict=True)}
    figures |= {"link_mbit": carried_mbit, "sim_speed": meter.speed()}
    figures |= {"worst_rate_error_pct": 100.0 * viewed[0], "unviewed_rate_error_pct": 100.0 * unviewed[0]}
    conditions: dict[str, Any] = {"mbit": mbit, "mission": mission, "profile": profile}
    return Result(figures, conditions | {"worst_topics": {"viewed": viewed[1], "unviewed": unviewed[1]}})


@contextmanager
def _link(mbit: float) -> Iterator[OtherHost]:
    """Another computer behind a cable with this rate in each direction."""
    with ExitStack() as stack:
        try:
            host = stack.enter_context(other_host(("tbf", "rate", f"{mbit}mbit", "burst", "32kb", "latency", "100ms")))
        except (OSError, subprocess.CalledProcessError) as error:
            raise BenchError(f"no network namespace (needs root and iproute2): {error}") from error
        yield host


@contextmanager
def _remote_view() -> Iterator[None]:
    command = [sys.executable, "-m", "robot_stack.cli", "run", "remote_view"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield
        if process.poll() is not None:
            raise BenchError(f"remote_view ended with code {process.returncode}")
    finally:
        process.terminate()
        process.wait()


def _sent_bytes(device: str) -> int:
    with open(f"/sys/class/net/{device}/statistics/tx_bytes", encoding="ascii") as counter:
        return int(counter.read())

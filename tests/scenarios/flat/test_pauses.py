"""Every process of the stack is paused in turn on a busy machine: the world waits, and the ride continues."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from robot_stack.core.world_clock import WorldClock
from robot_stack.supervisor.control import ask
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(900)


@contextlib.contextmanager
def busy_loop() -> Iterator[None]:
    process = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        yield
    finally:
        process.kill()
        process.wait()


def pause(name: str, pid: int) -> None:
    """Pauses a process until the world waits for it. A paused world process reports nothing."""
    clock = WorldClock.find()
    assert clock is not None
    os.kill(pid, signal.SIGSTOP)
    try:
        wait_for(lambda: Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "T", f"{name} stopped")
        if name != "sim_world":
            wait_for(lambda: name in clock.waiting_for, f"the world waits for {name}")
    finally:
        os.kill(pid, signal.SIGCONT)


def wait_a_moment(stack: StackUnderTest) -> None:
    """Waits for the world's time to pass, in which every process takes the messages sent before."""
    count = len(stack.truth.items)
    stack.truth.wait(lambda _: len(stack.truth.items) > count + 20, "a moment of the ride")


def test_each_process_is_paused_in_turn_and_the_goal_is_reached(stack: StackUnderTest) -> None:
    start = len(stack.safety.items)
    wait_a_moment(stack)  # the mission manager refuses a start until it has the state NORMAL that this test has seen
    with busy_loop():
        for process in ask("status")["processes"]:
            if stack.mission.last is None or stack.mission.last.state != "RUNNING":
                stack.command("START_MISSION", "short_hop")
                stack.mission.wait(lambda message: message.state == "RUNNING", "the mission runs")
            pause(process["name"], int(process["pid"]))
            wait_a_moment(stack)
        stack.mission.wait(lambda message: message.state == "COMPLETED", "the goal", 300.0)
    assert {item.safety_state for item in stack.safety.messages[start:]}.isdisjoint({"EMERGENCY_STOP"})

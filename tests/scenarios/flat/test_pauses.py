"""Every process of the stack is paused in turn on a busy machine: the world waits, and the ride goes on."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from robot_stack.core.world_clock import WorldClock
from robot_stack.supervisor.control import ask

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(900)
_PAUSE_S = 1.0  # of the machine's time, as ``_BETWEEN_S``: what is to be survived


@contextlib.contextmanager
def busy_loop() -> Iterator[None]:
    process = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        yield
    finally:
        process.kill()
        process.wait()


def pause(pid: int) -> str:
    """Returns for whom the world waited meanwhile."""
    clock = WorldClock.find()
    os.kill(pid, signal.SIGSTOP)
    try:
        time.sleep(_PAUSE_S)
        return "" if clock is None else clock.waiting_for
    finally:
        os.kill(pid, signal.SIGCONT)


def test_each_process_is_paused_in_turn_and_the_goal_is_reached(stack: StackUnderTest) -> None:
    start, waits = len(stack.safety.items), {}
    with busy_loop():
        for process in ask("status")["processes"]:
            if stack.mission.last is None or stack.mission.last.state != "RUNNING":
                stack.command("START_MISSION", "short_hop")
                stack.mission.wait(lambda message: message.state == "RUNNING", "the mission runs")
            waits[process["name"]] = pause(int(process["pid"]))
            count = len(stack.truth.items)
            stack.truth.wait(lambda _, begun=count: len(stack.truth.items) > begun + 20, "a moment of the ride")
        stack.mission.wait(lambda message: message.state == "COMPLETED", "the goal", 300.0)
    assert {item.safety_state for item in stack.safety.messages[start:]}.isdisjoint({"EMERGENCY_STOP"})
    # The status line names the one that is paused. The world itself is: its time stands still without a word.
    unnamed = [name for name, text in waits.items() if name not in text]
    assert unnamed == ["sim_world"], waits

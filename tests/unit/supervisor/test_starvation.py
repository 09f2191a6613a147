"""Real processes on one processor: one that runs, one that sleeps, one that gets no turn."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from robot_stack.supervisor.starvation import SUSPICIOUS_S, Starvation, turns
from tests.support.waiting import wait_for

LOOP = "while True: pass"


@contextmanager
def program(text: str, niceness: int = 0) -> Iterator[int]:
    """Runs on processor 0 only."""
    here = f"import os; os.sched_setaffinity(0, [0]); os.nice({niceness})\n{text}"
    with subprocess.Popen([sys.executable, "-c", here]) as process:
        try:
            yield process.pid
        finally:
            process.kill()


def test_one_that_waits_for_its_turn_is_excused() -> None:
    starvation = Starvation()
    with program(LOOP), program(LOOP, niceness=19) as starved:
        wait_for(lambda: starvation.of_silence("x", starved, 1.0, 0.0) > 0.5, "half a second of waiting")


def test_one_that_sleeps_is_not() -> None:
    with program("import time; print(flush=True); time.sleep(600)") as sleeper:
        wait_for(lambda: (seen := turns(sleeper)) is not None and not seen.runnable and seen.count > 0, "its sleep")
        starvation = Starvation()
        starvation.of_silence("x", sleeper, 1.0, 0.0)
        assert starvation.of_silence("x", sleeper, 60.0, 59.0) == pytest.approx(0.0, abs=0.05)


def test_a_heartbeat_starts_the_account_anew() -> None:
    starvation = Starvation()
    with program(LOOP), program(LOOP, niceness=19) as starved:
        wait_for(lambda: starvation.of_silence("x", starved, 1.0, 0.0) > 0.1, "some waiting")
        assert starvation.of_silence("x", starved, SUSPICIOUS_S / 2, 0.0) == 0.0
        assert starvation.of_silence("x", starved, 1.0, 0.0) < 0.1


def test_who_is_gone_is_not_excused() -> None:
    assert Starvation().of_silence("x", 2**22, 60.0, 60.0) == 0.0
    assert turns(os.getpid()) is not None

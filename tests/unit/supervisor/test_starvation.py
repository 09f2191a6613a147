"""How long a silent process has waited for a processor, and what the kernel says of real ones."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from robot_stack.supervisor.starvation import SUSPICIOUS_S, Starvation, Turns, turns
from tests.support.waiting import wait_for

LOOP = "while True: pass"
PID = 7


class Kernel:
    """What it says of a process."""

    def __init__(self) -> None:
        self.seen: Turns | None = Turns(10.0, 100, runnable=False)
        self.starvation = Starvation(lambda _: self.seen)

    def silent(self, now_s: float, silence_s: float = 1.0) -> float:
        return self.starvation.of_silence("x", PID, silence_s, now_s)


@pytest.fixture
def kernel() -> Kernel:
    return Kernel()


def test_one_that_waits_for_its_turn_is_excused(kernel: Kernel) -> None:
    kernel.seen = Turns(10.0, 100, runnable=True)
    assert kernel.silent(0.0) == 0.0
    assert kernel.silent(0.7) == pytest.approx(0.7)
    kernel.seen = Turns(10.9, 101, runnable=True)  # the wait has ended, and counts
    assert kernel.silent(1.0) == pytest.approx(0.9)


def test_one_that_sleeps_is_not(kernel: Kernel) -> None:
    assert kernel.silent(0.0) == 0.0
    assert kernel.silent(59.0) == 0.0
    kernel.seen = Turns(10.02, 103, runnable=False)
    assert kernel.silent(60.0) == pytest.approx(0.02)


def test_a_heartbeat_starts_the_account_anew(kernel: Kernel) -> None:
    kernel.seen = Turns(10.0, 100, runnable=True)
    kernel.silent(0.0)
    assert kernel.silent(1.0) == pytest.approx(1.0)
    assert kernel.silent(1.1, SUSPICIOUS_S / 2) == 0.0
    assert kernel.silent(1.2) == 0.0
    assert kernel.silent(1.3) == pytest.approx(0.1)


def test_one_that_has_never_beaten_or_is_gone_is_not_excused(kernel: Kernel) -> None:
    assert kernel.starvation.of_silence("x", PID, None, 0.0) == 0.0
    kernel.seen = None
    assert kernel.silent(60.0) == 0.0
    assert Starvation().of_silence("x", 2**22, 60.0, 60.0) == 0.0


# --- real processes --------------------------------------------------------------------------------------------------


@contextmanager
def program(text: str, niceness: int = 0) -> Iterator[int]:
    """Runs on processor 0 only."""
    here = f"import os; os.sched_setaffinity(0, [0]); os.nice({niceness})\n{text}"
    with subprocess.Popen([sys.executable, "-c", here]) as process:
        try:
            yield process.pid
        finally:
            process.kill()


def test_the_kernel_says_that_one_waits_for_its_turn() -> None:
    with program(LOOP), program(LOOP, niceness=19) as starved:
        wait_for(lambda: (seen := turns(starved)) is not None and seen.waited_s > 0.5, "half a second of waiting")
        wait_for(lambda: (seen := turns(starved)) is not None and seen.runnable, "its wish to run")


def test_the_kernel_says_that_one_sleeps() -> None:
    with program("import signal; signal.pause()") as sleeper:
        wait_for(lambda: (seen := turns(sleeper)) is not None and not seen.runnable and seen.count > 0, "its sleep")
    assert turns(os.getpid()) is not None

"""Waiting time of a silent process for a processor, and the kernel's data on real processes."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from robot_stack.supervisor.starvation import SUSPICIOUS_S, Starvation, Turns, turns
from tests.support.waiting import wait_for

LOOP = "while True: pass"
PID = 7


class Kernel:
    """The kernel's data on a process."""

    def __init__(self) -> None:
        self.seen: Turns | None = Turns(10.0, 100, runnable=False)
        self.others: dict[str, Turns] = {}
        self.starvation = Starvation(self._read)

    def _read(self, _: int) -> dict[str, Turns]:
        return {} if self.seen is None else {"main": self.seen, **self.others}

    def silent(self, now_s: float, silence_s: float = 1.0) -> float:
        return self.starvation.of_silence("x", PID, silence_s, now_s)


@pytest.fixture
def kernel() -> Kernel:
    return Kernel()


def test_one_that_waits_for_its_turn_is_excused(kernel: Kernel) -> None:
    kernel.seen = Turns(10.0, 100, runnable=True)
    assert kernel.silent(0.0) == 0.0
    assert kernel.silent(0.7) == pytest.approx(0.7)
    kernel.seen = Turns(10.9, 101, runnable=True)  # the completed wait counts
    assert kernel.silent(1.0) == pytest.approx(0.9)


def test_one_that_sleeps_is_not(kernel: Kernel) -> None:
    assert kernel.silent(0.0) == 0.0
    assert kernel.silent(59.0) == 0.0
    kernel.seen = Turns(10.02, 103, runnable=False)
    assert kernel.silent(60.0) == pytest.approx(0.02)


def test_silence_while_other_thread_waits_is_excused(kernel: Kernel) -> None:
    """That thread may hold the interpreter lock or a lock of the middleware."""
    kernel.others = {"new": Turns(3.0, 10, runnable=False), "ends": Turns(0.0, 1, runnable=True)}
    assert kernel.silent(0.0) == 0.0
    kernel.others = {"new": Turns(3.8, 20, runnable=True), "later": Turns(99.0, 1, runnable=True)}
    assert kernel.silent(1.0) == pytest.approx(0.8)


def test_heartbeat_resets_starvation_account(kernel: Kernel) -> None:
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
    kernel.seen = Turns(10.0, 100, runnable=True)  # measured from here on
    assert kernel.silent(61.0) == 0.0
    assert kernel.silent(62.0) == pytest.approx(1.0)
    assert Starvation().of_silence("x", 2**22, 60.0, 60.0) == 0.0


# --- real processes --------------------------------------------------------------------------------------------------


@contextmanager
def program(text: str, niceness: int = 0) -> Iterator[int]:
    """Runs a program on processor 0 only."""
    here = f"import os; os.sched_setaffinity(0, [0]); os.nice({niceness})\n{text}"
    with subprocess.Popen([sys.executable, "-c", here]) as process:
        try:
            yield process.pid
        finally:
            process.kill()


def of_main(pid: int) -> Turns | None:
    return turns(pid).get(str(pid))


def test_starved_process_is_reported_as_runnable_with_waiting_time() -> None:
    with program(LOOP), program(LOOP, niceness=19) as starved:
        wait_for(lambda: (seen := of_main(starved)) is not None and seen.waited_s > 0.5, "half a second of waiting")
        wait_for(lambda: (seen := of_main(starved)) is not None and seen.runnable, "its wish to run")


def test_sleeping_process_is_reported_as_not_runnable() -> None:
    with program("import signal; signal.pause()") as sleeper:
        wait_for(lambda: (seen := of_main(sleeper)) is not None and not seen.runnable and seen.count > 0, "its sleep")
    assert of_main(os.getpid()) is not None


def test_threads_of_lower_priority_do_not_count() -> None:
    """A helper thread of lower priority waits without end on a busy machine."""
    ids: list[int] = []

    def be_nice() -> None:
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), os.getpriority(os.PRIO_PROCESS, 0) + 1)
        ids.append(threading.get_native_id())
        done.wait()

    done = threading.Event()
    equal, nicer = threading.Thread(target=done.wait), threading.Thread(target=be_nice)
    equal.start()
    nicer.start()
    try:
        wait_for(lambda: ids, "its priority")
        seen = turns(os.getpid())
        assert str(equal.native_id) in seen
        assert str(nicer.native_id) not in seen
    finally:
        done.set()
        equal.join()
        nicer.join()

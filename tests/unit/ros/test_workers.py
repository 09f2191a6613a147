"""Jobs beside a node's loop, in a thread."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator

import pytest

from robot_stack.ros.workers import ThreadWorker
from tests.support.waiting import wait_for


class Loop:
    """A node's loop that runs on demand of the test."""

    def __init__(self) -> None:
        self.soon: deque[Callable[[], None]] = deque()

    def run(self) -> None:
        while self.soon:
            self.soon.popleft()()


@pytest.fixture
def loop() -> Loop:
    return Loop()


@pytest.fixture
def worker(loop: Loop) -> Iterator[ThreadWorker]:
    made = ThreadWorker("jobs", loop.soon.append)
    yield made
    made.close(5.0)


def test_results_come_in_order_in_the_loop(worker: ThreadWorker, loop: Loop) -> None:
    results: list[tuple[int, str, str]] = []

    def job(number: int) -> tuple[int, str]:
        return number, threading.current_thread().name

    def done(result: tuple[int, str]) -> None:
        results.append((*result, threading.current_thread().name))

    for number in range(3):
        worker.submit(lambda number=number: job(number), done)
    wait_for(lambda: len(loop.soon) == 3, "three results")
    assert results == []
    loop.run()
    here = threading.current_thread().name
    assert results == [(number, "jobs", here) for number in range(3)]


def test_a_worker_is_busy_until_its_results_are_in_the_loop(worker: ThreadWorker, loop: Loop) -> None:
    assert not worker.busy
    go, seen = threading.Event(), []
    worker.submit(lambda: go.wait(60.0), lambda _: seen.append(worker.busy))
    assert worker.busy
    go.set()
    wait_for(lambda: loop.soon, "the result")
    assert worker.busy
    loop.run()
    assert seen == [False]


def test_the_end_waits_for_the_jobs_that_are_queued(worker: ThreadWorker) -> None:
    ran: list[int] = []
    for number in range(20):
        worker.submit(lambda number=number: ran.append(number), lambda _: None)
    worker.close(60.0)
    assert ran == list(range(20))
    assert not worker._thread.is_alive()


def test_a_job_that_hangs_keeps_nobody_from_ending(worker: ThreadWorker) -> None:
    go = threading.Event()
    worker.submit(lambda: go.wait(60.0), lambda _: None)
    worker.close(0.05)
    assert worker._thread.is_alive()
    assert worker._thread.daemon, "an interpreter that ends would wait for it"
    go.set()

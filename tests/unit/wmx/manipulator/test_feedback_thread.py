"""The thread's deadlines, and how it ends."""

from __future__ import annotations

import gc
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from robot_stack.wmx.axes import empty_snapshot
from robot_stack.wmx.manipulator.startup import Progress, Step
from robot_stack.wmx.nodes import feedback_thread
from robot_stack.wmx.nodes.feedback_thread import FeedbackThread
from tests.support.waiting import wait_for

PERIOD_NS = 2_000_000


@pytest.fixture(autouse=True)
def _as_before() -> Iterator[None]:
    """The thread takes its process for its own."""
    interval_s = sys.getswitchinterval()
    yield
    sys.setswitchinterval(interval_s)
    gc.unfreeze()


class FakeBringUp:
    """Ready from the beginning. ``status``: what a poll answers."""

    def __init__(self) -> None:
        self.progress = Progress(Step.READY)
        self.status_problem = "no status"
        self.status: Any = empty_snapshot(6)
        self.lines: deque[Any] = deque()
        self.ends: list[bool] = []
        self.stops: set[bool] = set()

    def poll(self, now_s: float, stopped: Callable[[], bool]) -> Any:
        assert abs(now_s - time.monotonic()) < 60.0
        self.stops.add(stopped())
        if isinstance(self.status, Exception):
            raise self.status
        return self.status

    def end(self, hurry: bool) -> bool:
        self.ends.append(hurry)
        return len(self.ends) > 2


def thread(bring_up: FakeBringUp, publish: Any = lambda _: True, **changes: Any) -> FeedbackThread:
    settings = {"rate_hz": 500.0, "poll_s": 0.02, "end_timeout_s": 30.0} | changes
    return FeedbackThread(bring_up, publish, lambda: False, **settings)  # type: ignore[arg-type]


class FakeTime:
    """Time passes by sleeping, and by what a tick takes."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.late_ns = 0

    def monotonic_ns(self) -> int:
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.now_ns += round(1e9 * seconds) + self.late_ns


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> FakeTime:
    clock = FakeTime()
    fake = SimpleNamespace(monotonic_ns=clock.monotonic_ns, sleep=clock.sleep, monotonic=time.monotonic)
    monkeypatch.setattr(feedback_thread, "time", fake)
    return clock


def test_deadlines_are_absolute(clock: FakeTime):
    paced, due_ns = thread(FakeBringUp()), 0
    clock.late_ns = 300_000
    for number in range(1, 6):
        clock.now_ns += 100_000  # a tick's work
        due_ns = paced._sleep_until(due_ns + PERIOD_NS, PERIOD_NS)
        assert due_ns == number * PERIOD_NS
        assert clock.now_ns == due_ns + 300_000
    assert paced.overruns == 0
    assert paced.worst_late_ns == 300_000


def test_a_tick_that_took_less_than_a_period_too_long_leaves_none_out(clock: FakeTime):
    paced = thread(FakeBringUp())
    clock.now_ns = PERIOD_NS + 500_000
    assert paced._sleep_until(PERIOD_NS, PERIOD_NS) == PERIOD_NS
    assert clock.now_ns == PERIOD_NS + 500_000
    assert paced._sleep_until(2 * PERIOD_NS, PERIOD_NS) == 2 * PERIOD_NS
    assert clock.now_ns == 2 * PERIOD_NS
    assert paced.overruns == 0


def test_periods_that_are_past_are_left_out_and_counted(clock: FakeTime):
    paced = thread(FakeBringUp())
    clock.now_ns = 4 * PERIOD_NS + 500_000
    assert paced._sleep_until(PERIOD_NS, PERIOD_NS) == 4 * PERIOD_NS
    assert paced.overruns == 3
    paced._sleep_until(5 * PERIOD_NS, PERIOD_NS)
    assert clock.now_ns == 5 * PERIOD_NS  # on the grid again


def test_it_publishes_every_status_and_ends_in_order():
    bring_up = FakeBringUp()
    published: list[Any] = []
    paced = thread(bring_up, lambda snapshot: not published.append(snapshot))
    paced.start()
    wait_for(lambda: len(published) >= 5, "five ticks")
    paced.end()
    assert published[0] is bring_up.status
    assert paced.published == len(published)
    assert (paced.skipped, paced.failure) == (0, "")
    assert bring_up.ends == [False, False, False]
    assert bring_up.stops == {False}


@pytest.mark.parametrize("fit", [True, False])
def test_what_is_not_published_is_counted_with_its_reason(fit: bool):
    bring_up = FakeBringUp()
    if fit:
        bring_up.status = None
    paced = thread(bring_up, lambda _: fit)
    paced.start()
    wait_for(lambda: paced.skipped >= 3, "three ticks")
    paced.end()
    assert (paced.published, paced.snapshot, paced.reason) == (0, None, "no status")


def test_the_start_counts_nothing():
    bring_up = FakeBringUp()
    bring_up.status, bring_up.progress = None, Progress(Step.DEVICE)
    paced = thread(bring_up, poll_s=0.001)
    paced.start()
    wait_for(lambda: bring_up.stops, "a tick")
    paced.end()
    assert (paced.published, paced.skipped) == (0, 0)


def test_an_exception_is_kept_for_the_node():
    bring_up = FakeBringUp()
    bring_up.status = ZeroDivisionError("why")
    paced = thread(bring_up)
    paced.start()
    wait_for(lambda: paced.failure, "the failure")
    assert "ZeroDivisionError: why" in paced.failure
    paced.end()


def test_an_end_that_takes_too_long_hurries():
    bring_up = FakeBringUp()
    paced = thread(bring_up, end_timeout_s=0.0)
    paced.start()
    paced.end()
    assert bring_up.ends[-1] is True


def test_the_end_without_a_start():
    thread(FakeBringUp()).end()

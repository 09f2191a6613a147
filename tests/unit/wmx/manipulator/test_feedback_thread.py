"""The deadlines of the thread, and its end."""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Iterator
from typing import Any

import pytest

from robot_stack.wmx.axes import axis_feedback, empty_snapshot
from robot_stack.wmx.nodes.feedback_thread import FeedbackThread
from robot_stack.wmx.start_up import SessionState, Stage
from tests.support.waiting import wait_for


@pytest.fixture(autouse=True)
def _as_before() -> Iterator[None]:
    """Restores the process settings that the thread changes."""
    interval_s = sys.getswitchinterval()
    yield
    sys.setswitchinterval(interval_s)
    gc.unfreeze()


class FakeBringUp:
    """Ready from the start. ``status``: result of a poll. ``changed_at``: first look without a result."""

    def __init__(self) -> None:
        self.state = SessionState(Stage.READY, "no status")
        self.started = True
        self.status: Any = empty_snapshot(6)
        self.ends: list[bool] = []
        self.stops: set[bool] = set()
        self.polls = self.looks = self.changed_at = 0

    def poll(self, now_s: float, *, stop: bool) -> Any:
        assert abs(now_s - time.monotonic()) < 60.0
        self.stops.add(stop)
        self.polls += 1
        if isinstance(self.status, Exception):
            raise self.status
        return self.status

    def look(self, now_s: float) -> Any:
        self.looks += 1
        return axis_feedback(self.status) if self.changed_at == 0 or self.looks < self.changed_at else None

    def end(self, *, hurry: bool) -> bool:
        self.ends.append(hurry)
        return len(self.ends) > 2


def thread(bring_up: FakeBringUp, publish: Any = lambda _: "", **changes: Any) -> FeedbackThread:
    settings = {"rate_hz": 500.0, "poll_s": 0.02, "end_timeout_s": 30.0} | changes
    return FeedbackThread(bring_up, publish, lambda: False, **settings)  # type: ignore[arg-type]


def test_it_publishes_every_status_and_ends_in_order():
    bring_up = FakeBringUp()
    published: list[Any] = []
    paced = thread(bring_up, lambda feedback: published.append(feedback) or "")
    paced.start()
    wait_for(lambda: len(published) >= 5, "five ticks")
    paced.end()
    assert published[0] == axis_feedback(bring_up.status)
    assert paced.published == len(published)
    assert (paced.skipped, paced.failure) == (0, "")
    assert bring_up.ends == [False, False, False]
    assert bring_up.stops == {False}


@pytest.mark.parametrize("fit", [True, False])
def test_skipped_feedback_is_counted_with_reason(fit: bool):
    bring_up = FakeBringUp()
    if fit:
        bring_up.status = None
    paced = thread(bring_up, lambda _: "" if fit else "not finite")
    paced.start()
    wait_for(lambda: paced.skipped >= 3, "three ticks")
    paced.end()
    assert (paced.published, paced.snapshot, paced.reason) == (0, None, "no status" if fit else "not finite")


def test_between_polls_it_only_looks():
    bring_up = FakeBringUp()
    paced = thread(bring_up)
    paced.start()
    wait_for(lambda: paced.published >= 100, "a hundred ticks")
    paced.end()
    assert bring_up.polls + bring_up.looks == paced.published
    assert 0.2 / 0.05 <= bring_up.polls < 0.5 * paced.published
    assert paced.snapshot is bring_up.status


def test_poll_follows_insufficient_look_in_same_tick():
    bring_up = FakeBringUp()
    bring_up.changed_at = 3
    paced = thread(bring_up)
    paced.start()
    wait_for(lambda: bring_up.looks >= 3, "a look that does not suffice")
    wait_for(lambda: bring_up.polls >= 2, "the poll")
    paced.end()
    assert paced.skipped == 0


def test_the_start_counts_nothing():
    bring_up = FakeBringUp()
    bring_up.status, bring_up.started = None, False
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

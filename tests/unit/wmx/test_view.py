"""The thread that follows the engine's status, and pauses of that thread, which must not appear as a fault."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from robot_stack.wmx import view
from robot_stack.wmx.axes import StatusSnapshot, empty_snapshot
from robot_stack.wmx.view import EngineView

STALE = 1
POLL_HZ = 250.0


class Ended(Exception):
    """Ends the story."""


class Story:
    """An engine, and the virtual time of the thread that follows it.

    stale_from_s: time from which the engine's status is stale. hold: called at each reading, returns the time for
    which the thread is paused. statuses: the thread's reports with their times.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 0.0
        self.end_s = 2.0
        self.stale_from_s = float("inf")
        self.hold: Callable[[float], float] = lambda _: 0.0
        self.statuses: list[tuple[float, bool]] = []
        monkeypatch.setattr(view, "time", self)
        monkeypatch.setattr(view, "connect", lambda *_, **__: self)

    # Replaces the module time.
    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        self.now_s += duration_s
        if self.now_s >= self.end_s:
            raise Ended

    # Replaces an engine.
    def read_status(self) -> tuple[int, StatusSnapshot]:
        code = STALE if self.now_s >= self.stale_from_s else 0
        self.now_s += self.hold(self.now_s)
        return code, empty_snapshot()

    def close(self) -> None:
        """No resources to release."""

    def run(self) -> list[float]:
        """Returns the times at which the thread reported an unknown status after the first known one."""
        follower = EngineView("test", POLL_HZ, lambda status: self.statuses.append((self.now_s, status is not None)))
        with pytest.raises(Ended):
            follower._follow()
        first_s = next(at_s for at_s, known in self.statuses if known)
        return [at_s for at_s, known in self.statuses if not known and at_s > first_s]


@pytest.fixture
def story(monkeypatch: pytest.MonkeyPatch) -> Story:
    return Story(monkeypatch)


def test_a_status_is_reported_at_each_reading(story: Story) -> None:
    assert story.run() == []
    assert len(story.statuses) == pytest.approx(story.end_s * POLL_HZ, abs=2)


def test_a_silent_engine_is_reported_at_once(story: Story) -> None:
    story.stale_from_s = 1.0
    assert story.run()[0] == pytest.approx(1.0, abs=1.0 / POLL_HZ)


def test_after_a_pause_of_its_own_it_waits_a_little_before_it_calls_the_engine_silent(story: Story) -> None:
    pause_s = 0.12
    story.stale_from_s = 1.0
    story.hold = lambda now_s: pause_s if 0.99 <= now_s < 1.0 else 0.0
    silent_s = story.run()[0]
    resumed_s = max(at_s for at_s, known in story.statuses if known)
    assert silent_s - resumed_s == pytest.approx(0.05, abs=2.0 / POLL_HZ)


def test_pauses_without_end_excuse_nothing(story: Story) -> None:
    story.end_s = 10.0
    story.stale_from_s = 1.0
    story.hold = lambda _: 0.04
    assert story.run()[0] < 3.0

"""The engine's status as a thread follows it, and what a pause of that thread must not look like."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from robot_stack.wmx import view
from robot_stack.wmx.axes import StatusSnapshot, empty_snapshot
from robot_stack.wmx.view import EngineView
from tests.support.waiting import wait_for

STALE = 1


class Engine:
    """Whose status can be read or not; ``hold_s`` holds the reader up once, and the engine falls silent meanwhile."""

    def __init__(self) -> None:
        self.stale = False
        self.hold_s = 0.0

    def read_status(self) -> tuple[int, StatusSnapshot]:
        hold_s, self.hold_s = self.hold_s, 0.0
        code = STALE if self.stale else 0
        if hold_s:
            time.sleep(hold_s)
            self.stale = True
        return code, empty_snapshot()

    def close(self) -> None:
        """Nothing is held."""


@pytest.fixture
def followed(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Engine, list[tuple[float, Any]], Callable[[], None]]]:
    engine = Engine()
    monkeypatch.setattr(view, "connect", lambda *_, **__: engine)
    heard: list[tuple[float, Any]] = []
    follower = EngineView("test", 250.0, lambda status: heard.append((time.monotonic(), status)))
    follower.start()
    wait_for(lambda: any(status is not None for _, status in heard), "a status")
    yield engine, heard, follower.close
    follower.close()


def test_an_engine_that_falls_silent_is_told_at_once(
    followed: tuple[Engine, list[tuple[float, Any]], Callable[[], None]],
) -> None:
    engine, heard, _ = followed
    count = len(heard)
    engine.stale = True
    wait_for(lambda: any(status is None for _, status in heard[count:]), "the silence")


def test_after_a_pause_of_its_own_it_waits_a_little_before_it_calls_the_engine_silent(
    followed: tuple[Engine, list[tuple[float, Any]], Callable[[], None]],
) -> None:
    engine, heard, _ = followed
    count = len(heard)
    engine.hold_s = 0.12
    wait_for(lambda: any(status is None for _, status in heard[count:]), "the silence")
    resumed_s = max(at_s for at_s, status in heard[count:] if status is not None)
    silent_s = next(at_s for at_s, status in heard[count:] if status is None)
    assert 0.03 < silent_s - resumed_s < 0.25


def test_pauses_without_end_excuse_nothing(
    followed: tuple[Engine, list[tuple[float, Any]], Callable[[], None]],
) -> None:
    engine, heard, _ = followed
    engine.stale = True
    begun_s = time.monotonic()

    def silent() -> bool:
        engine.hold_s = engine.hold_s or 0.04
        return any(status is None and at_s > begun_s for at_s, status in heard)

    wait_for(silent, "the silence", 5.0)

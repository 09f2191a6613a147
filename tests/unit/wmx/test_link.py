"""A node's link to the engine, in fake time."""

from __future__ import annotations

import pytest

from robot_stack.wmx import EngineError
from robot_stack.wmx.api import ErrorCode
from robot_stack.wmx.axes import StatusSnapshot, empty_snapshot
from robot_stack.wmx.link import EngineLink


class FakeEngine:
    """``code``: what the status answers."""

    def __init__(self) -> None:
        self.api = self
        self.calls: list[str] = []
        self.code = 0

    def SetWatchdog(self, milliseconds: int) -> int:
        self.calls.append(f"SetWatchdog({milliseconds})")
        return 0

    def ResetWatchdogTimer(self) -> int:
        self.calls.append("ResetWatchdogTimer")
        return 0

    def read_status(self) -> tuple[int, StatusSnapshot]:
        return self.code, empty_snapshot(1)

    def close(self) -> None:
        self.calls.append("close")


@pytest.fixture
def engine() -> FakeEngine:
    return FakeEngine()


def link_to(engine: FakeEngine, watchdog_s: float) -> EngineLink:
    return EngineLink(lambda: engine, retry_s=0.5, feed_period_s=0.1, watchdog_s=watchdog_s)  # type: ignore[arg-type, return-value]


def test_watchdog_is_set_and_fed(engine: FakeEngine) -> None:
    link = link_to(engine, watchdog_s=0.3)
    for tick in range(30):
        assert link.poll(10.0 + 0.01 * tick)
    assert engine.calls == ["SetWatchdog(300)", *["ResetWatchdogTimer"] * 3]


def test_link_that_moves_nothing_has_no_watchdog(engine: FakeEngine) -> None:
    link = link_to(engine, watchdog_s=0.0)
    for tick in range(30):
        assert link.poll(10.0 + 0.1 * tick)
    assert engine.calls == []


def test_absent_engine_is_looked_for_at_its_pace() -> None:
    attempts = []

    def refuse() -> FakeEngine:
        attempts.append(None)
        raise EngineError("no device", ErrorCode.IMLibIsNotRunning, "no engine")

    link = EngineLink(refuse, retry_s=0.5, feed_period_s=0.1, watchdog_s=0.0)  # type: ignore[arg-type]
    for tick in range(11):
        assert not link.poll(10.0 + 0.1 * tick + 1e-6)
    assert len(attempts) == 3
    assert link.read() is None
    assert link.problem == "waiting for the motion engine"


def test_time_that_ran_back_makes_everything_due(engine: FakeEngine) -> None:
    link = link_to(engine, watchdog_s=0.0)
    assert link.due("request", 100.0, 5.0)
    assert not link.due("request", 104.9, 5.0)
    assert link.due("request", 50.0, 5.0)
    assert not link.due("request", 54.9, 5.0)
    assert link.due("request", 55.0, 5.0)


def test_refusal_is_kept_until_the_request_succeeds(engine: FakeEngine) -> None:
    link = link_to(engine, watchdog_s=0.0)
    assert not link.ask("request", lambda engine: 0), "there is no engine yet"
    link.poll(10.0)
    assert not link.ask("request", lambda engine: ErrorCode.SystemError)
    assert link.refusal("request", "none") == "request: SystemError (error 1280)"
    assert link.ask("request", lambda engine: 0)
    assert link.refusal("request", "none") == "none"


def test_dead_engine_is_given_up_and_opened_anew(engine: FakeEngine) -> None:
    link = link_to(engine, watchdog_s=0.0)
    link.poll(10.0)
    assert link.read() is not None
    engine.code = ErrorCode.APIChannelError
    assert link.read() is None
    assert (link.engine, link.problem) == (None, "the motion engine has ended")
    engine.code = 0
    assert link.poll(10.6)
    assert link.connections == 2
    link.close()
    assert engine.calls == ["close", "close"]

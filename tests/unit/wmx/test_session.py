"""A session with the engine, in fake time."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable
from typing import Any

import pytest

from robot_stack.wmx import EngineError
from robot_stack.wmx.api import ErrorCode
from robot_stack.wmx.axes import StatusSnapshot, empty_snapshot
from robot_stack.wmx.device_opener import ThreadedOpener
from robot_stack.wmx.failures import ABSENT
from robot_stack.wmx.session import EngineSession, Events, Patience
from tests.support.waiting import wait_for


class FakeEngine:
    """``code``: return code of the status."""

    def __init__(self) -> None:
        self.api = self
        self.calls: list[str] = []
        self.code = 0
        self.answer = 0

    def GetDeviceName(self) -> tuple[int, str]:
        self.calls.append("GetDeviceName")
        return self.answer, "node"

    def read_status(self) -> tuple[int, StatusSnapshot]:
        return self.code, empty_snapshot(1)

    def close(self) -> None:
        self.calls.append("close")


@pytest.fixture
def engine() -> FakeEngine:
    return FakeEngine()


PATIENCE = Patience(retry_s=0.5, attempts=5, attempt_pause_s=2.0, probe_period_s=0.1)


def session_with(open_engine: Callable[[], object], **options: Any) -> EngineSession:
    return EngineSession(open_engine, PATIENCE, **options)  # type: ignore[arg-type]


class Refusing:
    """Fails to open a device with one code after another; the last code repeats."""

    def __init__(self, *codes: int) -> None:
        self.codes, self.attempts = list(codes), 0

    def __call__(self) -> FakeEngine:
        self.attempts += 1
        code = self.codes.pop(0) if len(self.codes) > 1 else self.codes[0]
        raise EngineError("no device", code, "refused")


def test_session_polls_engine_at_low_rate(engine: FakeEngine) -> None:
    """No other call is made, since the library feeds the watchdog."""
    session = session_with(lambda: engine)
    for tick in range(30):
        assert session.poll(10.0 + 0.01 * tick)
    assert engine.calls == ["GetDeviceName"] * 2


def test_hanging_engine_is_polled_at_low_rate(engine: FakeEngine) -> None:
    session = session_with(lambda: engine)
    engine.answer = ErrorCode.APIChannelTimeOut
    engine.code = ErrorCode.StatusChannelError
    for tick in range(50):
        assert session.poll(10.0 + 0.1 * tick), "it may come back"
    assert engine.calls == ["GetDeviceName"] * 2
    assert session.read() is None
    assert session.engine is not None, "a status that only grows old"
    engine.answer = ErrorCode.IMLibIsNotRunning
    assert not session.poll(20.0)
    assert session.text == "the motion engine has ended"


@pytest.mark.parametrize("code", sorted(ABSENT))
def test_engine_that_cannot_be_opened_yet_is_waited_for(code: int) -> None:
    """The codes include the vendor's locks: another process creates a device or starts the engine."""
    open_engine = Refusing(code)
    session = session_with(open_engine)
    for tick in range(20):
        assert not session.poll(10.0 + 0.5 * tick + 1e-6)
        assert session.text == session.problem == "waiting for the motion engine"
        assert session.read() is None
    assert open_engine.attempts == 20
    impatient = EngineSession(Refusing(code), Patience(0.5, 5, 2.0, 0.1, waited_for=frozenset()))  # type: ignore[arg-type]
    impatient.poll(10.0)
    assert impatient.text.startswith("attempt 1 of 5: "), "the codes are the user's choice"


def test_rejecting_engine_is_retried_five_times_every_two_seconds(engine: FakeEngine) -> None:
    open_engine = Refusing(ErrorCode.ReachMaxChannelNumber)
    session = session_with(open_engine)
    texts = []
    for tick in range(100):
        assert not session.poll(10.0 + 0.1 * tick + 1e-6)
        texts.append(session.text)
    assert open_engine.attempts == 5
    assert texts[0].startswith("attempt 1 of 5: no device: refused (ReachMaxChannelNumber, error 278)")
    assert texts[-1].startswith("5 attempts failed, still trying: ")
    session.poll(30.0)
    assert open_engine.attempts == 6


def test_time_that_ran_back_makes_everything_due(engine: FakeEngine) -> None:
    session = session_with(lambda: engine)
    assert session.due("request", 100.0, 5.0)
    assert not session.due("request", 104.9, 5.0)
    assert session.due("request", 50.0, 5.0)
    assert not session.due("request", 54.9, 5.0)
    assert session.due("request", 55.0, 5.0)


def test_refusal_is_kept_until_the_request_succeeds(engine: FakeEngine) -> None:
    session = session_with(lambda: engine)
    assert not session.ask("request", lambda engine: 0), "there is no engine yet"
    session.poll(10.0)
    assert not session.ask("request", lambda engine: ErrorCode.SystemError)
    assert session.refusal("request", "none") == "request: SystemError (error 1280)"
    assert session.ask("request", lambda engine: 0)
    assert session.refusal("request", "none") == "none"


def test_dead_engine_is_closed_and_reopened(engine: FakeEngine) -> None:
    session = session_with(lambda: engine)
    session.poll(10.0)
    assert session.read() is not None
    engine.code = ErrorCode.APIChannelError
    assert session.read() is None
    assert (session.engine, session.problem) == (None, "the motion engine has ended")
    engine.code = 0
    assert session.poll(10.6)
    assert session.connections == 2
    session.close()
    assert engine.calls == ["close", "close"]


def test_events_report_failed_opened_and_lost_device(engine: FakeEngine) -> None:
    reported: list[object] = []
    events = Events(
        lambda _: reported.append("opened"),
        lambda error, n: reported.append((error.code, n)),
        lambda: reported.append("lost"),
    )
    refusing = Refusing(ErrorCode.ReachMaxChannelNumber)
    session = session_with(lambda: refusing() if len(reported) < 2 else engine, events=events)
    session.poll(10.0)
    session.poll(12.0)
    assert reported == [(ErrorCode.ReachMaxChannelNumber, 1), (ErrorCode.ReachMaxChannelNumber, 2)]
    assert session.poll(14.0)
    assert session.call(lambda engine: ErrorCode.SystemError) == ErrorCode.SystemError
    assert session.call(lambda engine: ErrorCode.DeviceIsNull) == ErrorCode.DeviceIsNull
    assert reported[2:] == ["opened", "lost"]
    assert session.call(lambda engine: 0) == ErrorCode.DeviceIsNull
    assert reported[2:] == ["opened", "lost"], "once"


# --- a thread of its own


class Slow:
    """Opens a device only once ``let`` is set."""

    def __init__(self, engine: FakeEngine) -> None:
        self.engine, self.let, self.attempts = engine, threading.Event(), 0
        self.refusal: BaseException | None = None

    def __call__(self) -> FakeEngine:
        self.attempts += 1
        assert self.let.wait(30.0)
        if self.refusal is not None:
            raise self.refusal
        return self.engine


def test_slow_device_creation_does_not_block_polling(engine: FakeEngine) -> None:
    slow = Slow(engine)
    session = session_with(slow, opener=ThreadedOpener)
    for tick in range(50):
        assert not session.poll(10.0 + 0.1 * tick)
    assert (slow.attempts, session.text) == (1, "waiting for the motion engine")
    slow.let.set()
    now_s = itertools.count(20.0, 0.01)  # checked at every poll, not every 0.5 s
    wait_for(lambda: session.poll(next(now_s)), "the device")
    assert (session.engine, session.text, slow.attempts) == (engine, "connected", 1)


def test_a_refusal_comes_out_of_the_thread(engine: FakeEngine) -> None:
    slow = Slow(engine)
    slow.refusal = EngineError("no device", ErrorCode.ReachMaxChannelNumber, "refused")
    slow.let.set()
    session = session_with(slow, opener=ThreadedOpener)
    now_s = itertools.count(10.0, 0.001)
    wait_for(lambda: session.poll(next(now_s)) or session.text.startswith("attempt 1 of 5: no device"), "the refusal")


def test_unexpected_exception_of_opener_thread_is_raised_by_poll(engine: FakeEngine) -> None:
    slow = Slow(engine)
    slow.refusal = ZeroDivisionError("a mistake")
    slow.let.set()
    session = session_with(slow, opener=ThreadedOpener)
    now_s = itertools.count(10.0, 0.001)
    with pytest.raises(ZeroDivisionError, match="a mistake"):
        wait_for(lambda: session.poll(next(now_s)), "the mistake")


def test_a_device_that_comes_after_the_end_is_given_back(engine: FakeEngine) -> None:
    slow = Slow(engine)
    session = session_with(slow, opener=ThreadedOpener)
    session.poll(10.0)
    session.close()
    slow.let.set()
    wait_for(lambda: "close" in engine.calls, "the device given back")
    assert session.engine is None


def test_a_device_that_is_open_and_not_taken_yet_is_given_back_at_the_end(engine: FakeEngine) -> None:
    slow = Slow(engine)
    slow.let.set()
    session = session_with(slow, opener=ThreadedOpener)
    session.poll(10.0)
    wait_for(lambda: "engine opening" not in {thread.name for thread in threading.enumerate()}, "the end of the thread")
    session.close()
    assert engine.calls == ["close"]

"""Timers of a node, in fake time."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.middleware.clocks import SystemClock
from robot_stack.middleware.timers import Schedule


class FakeClock:
    simulated = False

    def __init__(self, now_s: float = 100.0) -> None:
        self.now_s = now_s

    def ros_s(self) -> float:
        return self.now_s

    def ros_ns(self) -> int:
        return round(1e9 * self.now_s)

    def timer_s(self) -> float:
        return self.now_s

    def age_s(self, real_s: float) -> float:
        return real_s

    def real_wait_s(self, due_s: float) -> float:
        return due_s - self.now_s


def test_a_system_clock_that_is_set_back_holds_up_no_timer(monkeypatch: pytest.MonkeyPatch) -> None:
    steady_s, system_s = 100.0, 1.8e9
    monkeypatch.setattr("time.monotonic", lambda: steady_s)
    monkeypatch.setattr("time.time", lambda: system_s)
    schedule, calls = Schedule(SystemClock()), []
    schedule.add(0.05, lambda: calls.append(steady_s))
    for _ in range(4):
        system_s -= 3.0
        steady_s += 0.05
        assert schedule.wait_s() <= 1e-9
        run(schedule)
    assert len(calls) == 4


def run(schedule: Schedule) -> None:
    for callback in schedule.due():
        callback()


def test_timers_fire_at_whole_periods() -> None:
    clock = FakeClock()
    schedule = Schedule(clock)
    calls: list[str] = []
    schedule.add(0.1, lambda: calls.append("fast"))
    clock.now_s = 100.03
    schedule.add(0.2, lambda: calls.append("slow"))
    assert schedule.wait_s() == pytest.approx(0.07)
    clock.now_s = 100.1
    run(schedule)
    assert calls == ["fast"]
    clock.now_s = 100.2
    run(schedule)
    assert calls == ["fast", "fast", "slow"]


def test_missed_calls_are_not_made_up_for() -> None:
    clock = FakeClock()
    schedule = Schedule(clock)
    calls: list[float] = []
    schedule.add(0.1, lambda: calls.append(clock.now_s))
    clock.now_s = 100.55
    run(schedule)
    run(schedule)
    assert calls == [100.55]
    assert schedule.next_due_s() == pytest.approx(100.6)


def test_cancel_reset_destroy() -> None:
    clock = FakeClock()
    schedule = Schedule(clock)
    calls: list[int] = []
    timer = schedule.add(0.1, lambda: calls.append(1))
    timer.cancel()
    assert timer.is_canceled()
    clock.now_s = 101.05
    run(schedule)
    assert calls == []
    timer.reset()
    assert timer.due_s == pytest.approx(101.15)
    timer.destroy()
    clock.now_s = 102.0
    run(schedule)
    assert calls == []
    assert schedule.next_due_s() == math.inf


def test_a_timer_cancelled_by_another_does_not_fire() -> None:
    clock = FakeClock()
    schedule = Schedule(clock)
    calls: list[str] = []
    schedule.add(0.1, lambda: other.cancel())
    other = schedule.add(0.1, lambda: calls.append("other"))
    clock.now_s = 100.1
    run(schedule)
    assert calls == []


def test_clock_set_back_does_not_stop_timers() -> None:
    clock = FakeClock()
    schedule = Schedule(clock)
    calls: list[float] = []
    schedule.add(0.1, lambda: calls.append(clock.now_s))
    clock.now_s = 1.0
    run(schedule)
    clock.now_s = 1.11
    run(schedule)
    assert calls == [1.11]


@pytest.mark.parametrize("period_s", [0.0, -1.0, math.inf, math.nan])
def test_invalid_timer_period_is_rejected(period_s: float) -> None:
    with pytest.raises(ValueError, match="period"):
        Schedule(FakeClock()).add(period_s, lambda: None)


@given(st.floats(0.001, 10.0), st.lists(st.floats(0.0, 5.0), max_size=50))
def test_never_early_never_twice_always_in_the_future(period_s: float, steps_s: list[float]) -> None:
    clock = FakeClock()
    schedule = Schedule(clock)
    calls: list[float] = []
    schedule.add(period_s, lambda: calls.append(clock.now_s))
    for step_s in steps_s:
        clock.now_s += step_s
        before = len(calls)
        run(schedule)
        assert len(calls) - before <= 1
        assert schedule.next_due_s() > clock.now_s
    assert len(calls) <= (clock.now_s - 100.0) / period_s + 1e-6


def test_held_timers_fire_after_release() -> None:
    clock, held, asked = FakeClock(), [True], [0]

    def is_held() -> bool:
        asked[0] += 1
        return held[0]

    schedule = Schedule(clock, is_held)
    schedule.add(1.0, lambda: None)
    assert list(schedule.due()) == []
    assert asked == [0]  # nothing was due
    clock.now_s += 1.0
    assert list(schedule.due()) == []
    assert schedule.next_due_s() == 101.0  # the world must detect that the node is late
    held[0] = False
    assert len(list(schedule.due())) == 1

"""Deadlines and wake-ups on a clock that advances only while sleeping, and the system's timer slack, read back."""

from __future__ import annotations

import ctypes
import sys
import threading
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.pacing import Pacer, Sleeper, SpinLimits, SpinMargin, sharpen_sleep

_PR_GET_TIMERSLACK = 30
MS = 1_000_000
US = 1_000
SPIN = SpinLimits(longest_s=0.00015, share=0.05, tolerance_s=0.00001, on_time=0.99)


class FakeTime:
    """Time advances by sleeping, by the duration of a tick, and slightly with each reading of the clock."""

    def __init__(self) -> None:
        self.ns = 0
        self.late_ns = 0
        self.look_ns = 0
        self.slept: list[float] = []

    def now_ns(self) -> int:
        self.ns += self.look_ns
        return self.ns

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.slept.append(seconds)
        self.ns += round(1e9 * seconds) + self.late_ns

    def sleeper(self, spin: SpinLimits | None = None) -> Sleeper:
        return Sleeper(spin, self.now_ns, self.sleep)

    def pacer(self, period_ns: int, spin: SpinLimits | None = None) -> Pacer:
        return Pacer(period_ns, self.sleeper(spin), self.now_ns)


@pytest.fixture
def clock() -> FakeTime:
    return FakeTime()


def test_deadlines_are_absolute(clock: FakeTime):
    pacer = clock.pacer(2 * MS)
    clock.late_ns = 300 * US
    for number in range(1, 6):
        clock.ns += 100 * US  # a tick's work
        pacer.wait()
        assert pacer.due_ns == number * 2 * MS
        assert clock.ns == pacer.due_ns + 300 * US
        assert pacer.late_ns == 300 * US
    assert (pacer.missed, len(clock.slept)) == (0, 5), "without limits it never waits awake"


def test_periods_that_are_past_are_left_out_and_counted(clock: FakeTime):
    pacer = clock.pacer(2 * MS)
    clock.ns = 8 * MS + 500 * US
    pacer.wait()
    assert (pacer.late_ns, pacer.missed) == (6 * MS + 500 * US, 3)
    assert clock.slept == []
    pacer.wait()
    assert clock.ns == 10 * MS, "on the grid again"


def test_another_period_counts_from_the_deadline_before(clock: FakeTime):
    with pytest.raises(ValueError, match="period_ns must be above zero, is 0"):
        clock.pacer(0)
    pacer = clock.pacer(20 * MS)
    pacer.wait()
    pacer.period_ns = 2 * MS
    clock.ns += MS
    pacer.wait()
    assert clock.ns == 22 * MS


@given(st.lists(st.tuples(st.integers(0, 5 * MS), st.integers(0, 3 * MS)), max_size=60), st.booleans())
def test_no_drift_never_early_never_a_burst(ticks: list[tuple[int, int]], spin: bool):
    clock = FakeTime()
    clock.look_ns = 50
    pacer = clock.pacer(MS, SPIN if spin else None)
    grid_ns = pacer.due_ns
    begun_ns = [clock.ns]
    for work_ns, late_ns in ticks:
        clock.ns += work_ns
        clock.late_ns = late_ns
        pacer.wait()
        assert clock.ns >= pacer.due_ns
        assert (pacer.due_ns - grid_ns) % MS == 0
        begun_ns.append(clock.ns)
    cells = [(ns - grid_ns) // MS for ns in begun_ns]
    assert all(later > earlier for earlier, later in pairwise(cells)), "one tick in a period"
    assert cells[-1] == len(ticks) + pacer.missed


def test_it_learns_to_be_awake_in_time(clock: FakeTime):
    clock.late_ns, clock.look_ns = 40 * US, 100
    pacer = clock.pacer(MS, SPIN)
    late_us = []
    for _ in range(200):
        pacer.wait()
        late_us.append(pacer.late_ns / US)
    assert late_us[0] >= 40.0
    assert max(late_us[50:]) <= 10.0 + 2.0, "the tolerance, and a step of learning"


def test_it_learns_that_less_is_enough():
    margin = SpinMargin(SPIN)
    for number in range(200):
        margin.take(number * MS)
        margin.learn(80 * US)
    assert margin.take(300 * MS) == pytest.approx(70 * US, abs=3 * US)
    for number in range(300, 10_000):
        margin.take(number * MS)
        margin.learn(20 * US)
    assert margin.take(10_000 * MS) == pytest.approx(10 * US, abs=3 * US)


def test_a_wake_up_that_no_margin_would_have_covered_teaches_nothing():
    margin = SpinMargin(SPIN)
    for number in range(1000):
        margin.take(number * MS)
        margin.learn(5 * MS)
    assert margin.take(1000 * MS) == 0


@given(st.lists(st.tuples(st.integers(0, 900 * US), st.integers(0, 400 * US)), min_size=1, max_size=300))
def test_waiting_awake_never_costs_more_than_its_share(ticks: list[tuple[int, int]]):
    clock = FakeTime()
    spent_ns = 0

    class Counting(SpinMargin):
        def spend(self, awake_ns: int) -> None:
            nonlocal spent_ns
            assert awake_ns <= SPIN.longest_s * 1e9
            spent_ns += awake_ns
            super().spend(awake_ns)

    sleeper = clock.sleeper(SPIN)
    sleeper._margin = Counting(SPIN)
    clock.look_ns = 50
    pacer = Pacer(MS, sleeper, clock.now_ns)
    for work_ns, late_ns in ticks:
        clock.ns += work_ns
        clock.late_ns = late_ns
        pacer.wait()
        assert spent_ns <= SPIN.share * clock.ns + 1


def test_sleeps_of_the_calling_thread_are_sharp_on_linux(monkeypatch: pytest.MonkeyPatch):
    seen: list[tuple[bool, int]] = []

    def ask() -> None:
        done = sharpen_sleep()
        seen.append((done, ctypes.CDLL(None).prctl(_PR_GET_TIMERSLACK, 0, 0, 0, 0)))

    thread = threading.Thread(target=ask)
    thread.start()
    thread.join()
    assert seen == [(True, 1)]
    monkeypatch.setattr(sys, "platform", "darwin")
    assert sharpen_sleep() is False

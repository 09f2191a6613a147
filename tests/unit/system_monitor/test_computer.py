"""The computer's figures: windows, hottest zones, the kernel's texts; unknown values are NaN."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.system_monitor.computer import (
    CpuTimes,
    CpuUsage,
    ProcessFigures,
    celsius_of,
    describe_process,
    hottest,
    pressure_avg10,
    together,
)


def test_use_is_the_mean_over_the_window() -> None:
    usage = CpuUsage(0.3)
    assert math.isnan(usage.update(CpuTimes(100.0, 1000.0), 1.0))
    assert math.isnan(usage.update(CpuTimes(100.1, 1000.2), 1.1))
    assert math.isnan(usage.update(CpuTimes(100.2, 1000.4), 1.2))
    assert usage.update(CpuTimes(100.3, 1000.6), 1.3) == pytest.approx(50.0)
    assert usage.update(CpuTimes(100.5, 1000.8), 1.4) == pytest.approx(100.0 * 0.4 / 0.6)
    assert usage.update(CpuTimes(100.7, 1001.0), 1.5) == pytest.approx(100.0 * 0.5 / 0.6)
    assert usage.update(CpuTimes(100.9, 1001.2), 1.6) == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("times", "now_s"),
    [
        (None, 2.0),
        (CpuTimes(0.5, 9.0), 2.0),  # counters that run backwards
        (CpuTimes(2.0, 3.0), 2.0),
        (CpuTimes(9.0, 9.0), 0.5),  # the clock runs backwards
        (CpuTimes(9.0, 9.0), 1.0),
        (CpuTimes(1.0, 4.0), 2.0),  # nothing has been counted
    ],
)
def test_implausible_cpu_times_yield_nan_usage(times: CpuTimes | None, now_s: float) -> None:
    usage = CpuUsage(0.3)
    usage.update(CpuTimes(1.0, 4.0), 1.0)
    assert math.isnan(usage.update(times, now_s))


def test_cpu_usage_restarts_after_gap() -> None:
    usage = CpuUsage(0.3)
    usage.update(CpuTimes(1.0, 4.0), 1.0)
    usage.update(None, 1.1)
    assert math.isnan(usage.update(CpuTimes(2.0, 5.0), 2.0))
    assert usage.update(CpuTimes(2.5, 6.0), 3.0) == pytest.approx(50.0)
    assert usage.update(CpuTimes(5.5, 9.0), 6.0) == pytest.approx(100.0), "rare looks: since the last one"


@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.01, 1.0)), max_size=30))
def test_use_is_between_0_and_100_or_unknown(steps: list[tuple[float, float, float]]) -> None:
    usage, busy_s, total_s, now_s = CpuUsage(0.3), 0.0, 0.0, 0.0
    for busy, idle, dt_s in steps:
        busy_s, total_s, now_s = busy_s + busy, total_s + busy + idle, now_s + dt_s
        percent = usage.update(CpuTimes(busy_s, total_s), now_s)
        assert math.isnan(percent) or 0.0 <= percent <= 100.0


def test_hottest_zone() -> None:
    assert hottest({"a": 40.0, "b": 61.5, "c": math.nan}) == ("b", 61.5)
    for zones in ({}, {"a": math.nan}, {"a": math.inf}):
        name, celsius = hottest(zones)
        assert (name, math.isnan(celsius)) == ("", True)


@pytest.mark.parametrize(
    ("text", "celsius"), [("45123\n", 45.123), ("-2000", -2.0), ("", math.nan), ("N/A\n", math.nan)]
)
def test_temperature_of_a_zone(text: str, celsius: float) -> None:
    assert celsius_of(text) == pytest.approx(celsius, nan_ok=True)


@pytest.mark.parametrize(
    ("text", "percent"),
    [
        ("some avg10=18.20 avg60=28.77 avg300=43.99 total=745\nfull avg10=1.00 avg60=0 avg300=0 total=0\n", 18.2),
        ("full avg10=1.00 avg60=0 avg300=0 total=0\n", math.nan),
        ("some avg60=1.0 total=0\n", math.nan),
        ("some avg10=? avg60=1.0 total=0\n", math.nan),
        ("", math.nan),
    ],
)
def test_pressure(text: str, percent: float) -> None:
    assert pressure_avg10(text) == pytest.approx(percent, nan_ok=True)


def test_processes() -> None:
    one, other = ProcessFigures("a", 2.0, 30.0, 10.0), ProcessFigures("b", 1.5, 20.0)
    assert describe_process(one) == "cpu 2.0 %, rss 30.0 MB, pss 10.0 MB"
    assert describe_process(together([one, other])) == "cpu 3.5 %, rss 50.0 MB, pss unknown"

"""Monitoring of the computer and its links: stale values, time under load, and when a link counts as missing."""

from __future__ import annotations

import math

import pytest

from robot_stack.safety.computer_watch import ComputerWatch, LinkWatch
from robot_stack.safety.inputs import ComputerState


def watch() -> ComputerWatch:
    return ComputerWatch(cpu_high_percent=95.0, status_stale_s=1.0, temperature_stale_s=2.0)


def same(state: ComputerState, *expected: float) -> bool:
    values = (
        state.temperature_c,
        state.cpu_percent,
        state.cpu_high_for_s,
        state.memory_percent,
        state.disk_percent,
    )
    return values == pytest.approx(expected, nan_ok=True)


def test_all_values_are_unknown_at_first() -> None:
    assert same(watch().state(1.0), math.nan, math.nan, 0.0, math.nan, math.nan)


def test_values_are_available_until_they_are_stale() -> None:
    computer = watch()
    computer.usage(10.0, 20.0, 30.0, 1.0)
    computer.temperature(40.0, 1.0)
    assert same(computer.state(2.0), 40.0, 10.0, 0.0, 20.0, 30.0)
    assert same(computer.state(2.01), 40.0, math.nan, 0.0, math.nan, math.nan)
    assert same(computer.state(3.0), 40.0, math.nan, 0.0, math.nan, math.nan)
    assert same(computer.state(3.01), math.nan, math.nan, 0.0, math.nan, math.nan)


def test_non_finite_and_out_of_range_values_are_rejected() -> None:
    computer = watch()
    computer.usage(10.0, 20.0, 30.0, 1.0)
    computer.temperature(40.0, 1.0)
    computer.usage(math.nan, 101.0, -1.0, 1.5)
    computer.temperature(300.0, 1.5)
    computer.temperature(-100.0, 1.5)
    assert same(computer.state(1.9), 40.0, 10.0, 0.0, 20.0, 30.0)
    assert math.isnan(computer.state(2.4).cpu_percent)
    computer.usage(0.0, 100.0, 100.0, 2.5)
    computer.temperature(-60.0, 2.5)
    assert same(computer.state(2.5), -60.0, 0.0, 0.0, 100.0, 100.0)
    computer.temperature(250.0, 2.5)
    assert computer.state(2.5).temperature_c == 250.0


def test_busy_time_counts_without_a_break() -> None:
    computer = watch()
    for at_s, percent, busy_s in (
        (1.0, 96.0, 0.0),
        (1.5, 100.0, 0.5),
        (2.0, 95.1, 1.0),
        (2.5, 95.0, 0.0),
        (3.0, 99.0, 0.0),
        (3.5, 99.0, 0.5),
    ):
        computer.usage(percent, 0.0, 0.0, at_s)
        assert computer.state(at_s).cpu_high_for_s == busy_s
    assert computer.state(4.6).cpu_high_for_s == 0.0  # the last value is stale
    computer.usage(99.0, 0.0, 0.0, 5.0)
    assert computer.state(5.0).cpu_high_for_s == 0.0


def test_a_link_is_missed_from_the_first_heartbeat_of_its_process_on() -> None:
    link = LinkWatch(expected=True)
    assert link.silent_s(1.0) is None
    link.process_heard(2.0)
    assert link.silent_s(4.0) == 2.0
    link.process_heard(5.0)
    assert link.silent_s(6.0) == 4.0
    link.alive(7.0)
    assert link.silent_s(7.5) == 0.5
    assert link.silent_s(6.0) == math.inf  # the clock jumped backwards


def test_a_link_that_is_not_required_is_missed_only_after_it_has_been_up() -> None:
    link = LinkWatch(expected=True, required=False)
    link.process_heard(2.0)
    assert link.silent_s(100.0) is None
    link.alive(101.0)
    assert link.silent_s(103.0) == 2.0


def test_a_status_without_a_link_is_silence() -> None:
    link = LinkWatch(expected=True)
    link.status(True, 1.0)
    link.status(False, 3.0)
    assert link.silent_s(4.0) == 3.0


def test_processes_outside_the_profile_are_not_missed() -> None:
    link = LinkWatch(expected=False)
    link.process_heard(1.0)
    link.alive(2.0)
    assert link.silent_s(99.0) is None

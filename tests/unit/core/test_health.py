"""Input health in fake time."""

from __future__ import annotations

import math

from robot_stack.core.health import InputHealth


def _health(stale_s: float | None = 0.1) -> InputHealth:
    health = InputHealth()
    health.add("imu", stale_s)
    return health


def test_never_received_is_infinitely_old_and_not_fresh() -> None:
    health = _health()
    assert health.age_s("imu", 5.0) == math.inf
    assert not health.fresh("imu", 5.0)
    assert not _health(None).fresh("imu", 5.0)


def test_fresh_up_to_the_limit() -> None:
    health = _health()
    health.received("imu", 1.0)
    assert health.fresh("imu", 1.0)
    assert health.fresh("imu", 1.0999)
    assert not health.fresh("imu", 1.1001)


def test_without_a_limit_the_first_message_is_enough() -> None:
    health = _health(None)
    health.received("imu", 1.0)
    assert health.fresh("imu", 1e6)


def test_time_that_runs_backwards_is_not_fresh() -> None:
    health = _health()
    health.received("imu", 100.0)
    assert not health.fresh("imu", 3.0)
    health.received("imu", 3.0)
    assert health.fresh("imu", 3.05)


def test_rate_over_a_window() -> None:
    health = _health()
    for i in range(301):
        health.received("imu", i * 0.01)
    state = health.check(3.0)["imu"]
    assert abs(state.rate_hz - 100.0) < 0.5
    assert state.received == 301


def test_rate_is_unknown_first_and_zero_when_silent() -> None:
    health = _health()
    health.received("imu", 0.0)
    assert math.isnan(health.check(0.05)["imu"].rate_hz)
    assert health.check(1.0)["imu"].rate_hz == 0.0


def test_removed_input_is_not_reported_stale() -> None:
    health = _health()
    health.received("imu", 0.0)
    health.remove("imu")
    assert health.check(9.0) == {}
    health.remove("imu")

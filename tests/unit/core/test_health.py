"""Input health in fake time."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.health import InputHealth


def _health(stale_s: float | None = 0.1) -> InputHealth:
    health = InputHealth()
    health.add("imu", stale_s)
    return health


@pytest.mark.parametrize(
    ("stale_s", "received_s", "now_s", "fresh"),
    [
        (0.1, None, 5.0, False),
        (None, None, 5.0, False),
        (0.1, 1.0, 1.0, True),
        (0.1, 1.0, 1.0999, True),
        (0.1, 1.0, 1.1001, False),
        (None, 1.0, 1e6, True),
        (0.1, 100.0, 3.0, False),  # time that runs backwards
    ],
)
def test_fresh(stale_s: float | None, received_s: float | None, now_s: float, fresh: bool) -> None:
    health = _health(stale_s)
    assert health.age_s("imu", now_s) == math.inf
    if received_s is not None:
        health.received("imu", received_s)
    assert health.fresh("imu", now_s) is fresh
    health.received("imu", now_s)
    assert health.fresh("imu", now_s + 0.05)


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

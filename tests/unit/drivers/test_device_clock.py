"""A device's clock mapped to the computer's: the effects of jitter, drift and jumps."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.drivers.device_clock import DeviceClock, DeviceClockParams, Unwrapped

PARAMS = DeviceClockParams(window_s=60.0, drift_max_ppm=200.0, jump_s=0.05, confirm_s=2.0)
EPOCH_S = 1_795_000_000.0


def run(clock: DeviceClock, begin_s: float, end_s: float, delay, drift: float = 0.0, offset_s: float = EPOCH_S):
    """Returns (error s, arrival - estimate s) of each sample at 100 Hz. ``delay`` returns the delay of the line."""
    found = []
    for taken_s in np.arange(begin_s, end_s, 0.01):
        arrival_s = offset_s + taken_s + delay(taken_s)
        estimate_s = clock.update(taken_s * (1.0 + drift), arrival_s)
        found.append((estimate_s - (offset_s + taken_s), arrival_s - estimate_s))
    return np.array(found)


def test_jitter_disappears_and_the_fastest_message_counts() -> None:
    random = np.random.default_rng(1)
    errors = run(DeviceClock(PARAMS), 0.0, 120.0, lambda _: 0.001 + random.exponential(0.004))
    settled = errors[6000:, 0]
    assert settled.mean() == pytest.approx(0.001, abs=2e-4)  # the fixed part of the delay is not observable
    assert settled.std() < 1e-4
    assert (errors[:, 1] >= -1e-6).all(), "no sample is later than its arrival"


@pytest.mark.parametrize("ppm", [-100.0, 150.0])
def test_drift_is_followed(ppm: float) -> None:
    random = np.random.default_rng(2)
    clock = DeviceClock(PARAMS)
    errors = run(clock, 0.0, 300.0, lambda _: random.exponential(0.003), drift=1e-6 * ppm)
    assert clock.drift_ppm == pytest.approx(-ppm, abs=10.0)
    assert abs(errors[12000:, 0]).max() < 1e-3
    assert clock.jumps == 0


def test_clock_drift_estimate_is_bounded() -> None:
    clock = DeviceClock(PARAMS)
    run(clock, 0.0, 30.0, lambda _: 0.0, drift=-1e-3)
    assert clock.drift_ppm == pytest.approx(200.0)


def test_a_line_that_is_held_up_moves_nothing() -> None:
    clock = DeviceClock(PARAMS)
    errors = run(clock, 0.0, 40.0, lambda at_s: 0.3 if 20.0 < at_s < 21.5 else 0.001)
    assert clock.jumps == 0
    assert abs(errors[1000:, 0] - 0.001).max() < 2e-4


@pytest.mark.parametrize("step_s", [-1.0, -0.06])
def test_clock_set_back_is_detected_immediately(step_s: float) -> None:
    clock = DeviceClock(PARAMS)
    run(clock, 0.0, 20.0, lambda _: 0.001)
    errors = run(clock, 20.0, 21.0, lambda _: 0.001, offset_s=EPOCH_S + step_s)
    assert clock.jumps == 1
    assert abs(errors[:, 0] - 0.001).max() < 2e-4
    restarted = run(clock, 0.0, 1.0, lambda _: 0.001, offset_s=EPOCH_S + 30.0)
    assert clock.jumps == 2, "the device begins at zero again"
    assert abs(restarted[:, 0] - 0.001).max() < 1e-4


def test_clock_set_ahead_is_detected_once_it_persists() -> None:
    clock = DeviceClock(PARAMS)
    run(clock, 0.0, 20.0, lambda _: 0.001)
    errors = run(clock, 20.0, 25.0, lambda _: 0.001, offset_s=EPOCH_S + 1.0)
    assert clock.jumps == 1
    assert abs(errors[250:, 0] - 0.001).max() < 2e-4
    assert abs(errors[:150, 0] + 1.0).max() < 0.01


def test_two_messages_of_one_moment() -> None:
    clock = DeviceClock(PARAMS)
    assert clock.update(1.0, 10.02) == pytest.approx(10.02)
    assert clock.update(1.0, 10.01) == pytest.approx(10.01)
    assert clock.update(1.0, 10.03) == pytest.approx(10.01)


def test_counters_overflow_and_go_back() -> None:
    ticks = Unwrapped(2**32)
    assert [ticks.update(value) for value in (2**32 - 1, 0, 5, 3, 2**31)] == [
        2**32 - 1, 2**32, 2**32 + 5, 2**32 + 3, 2**32 + 2**31,
    ]  # fmt: skip

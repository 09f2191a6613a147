"""The system clock compared with the steady clock."""

from __future__ import annotations

import pytest

from robot_stack.system_monitor.clock import ClockWatch


@pytest.mark.parametrize(("step_s", "steps"), [(0.0, 0), (0.06, 1), (-3600.0, 1)])
def test_a_step_is_counted_once(step_s: float, steps: int) -> None:
    watch = ClockWatch(0.05)
    watch.update(1000.0, 0.0)
    for second in range(1, 4):
        state = watch.update(1000.0 + second + step_s, float(second))
        assert state.steps == steps
        assert state.last_step_s == pytest.approx(step_s)
        assert state.offset_s == pytest.approx(step_s)


def test_a_clock_that_is_slewed_drifts_without_steps() -> None:
    watch = ClockWatch(0.05)
    watch.update(0.0, 0.0)
    for second in range(1, 101):
        state = watch.update(second * 1.02, float(second))
    assert (state.steps, state.offset_s) == (0, pytest.approx(2.0))

"""The draw and the figures of the benchmark of hours."""

from __future__ import annotations

import pytest

from custom_msgs.msg import MissionOrder
from tests.benchmarks.soak import AIMS, Fault, Notes, Size, figures


def notes() -> Notes:
    """Two orders that ended, one that waits; one process killed twice and restarted twice."""
    return Notes(
        orders=["a", "b", "c"],
        ended={"a": MissionOrder.COMPLETED, "b": MissionOrder.FAILED},
        waiting={"c"},
        faults=[Fault(1.0, "touch_ui"), Fault(2.0, "touch_ui"), Fault(3.0, "emergency stop")],
        restarts={"touch_ui": 2},
        sizes=[Size(0.0, 100_000_000, 0, 0), Size(1800.0, 101_000_000, 500_000, 2_000_000)],
        simulated_s=1800.0,
    )


def test_a_run_without_losses_meets_its_aims() -> None:
    found = figures(notes())
    assert [name for name, aim in AIMS.items() if not aim.met(found[name])] == []
    assert (found["orders_completed"], found["orders_failed"], found["restarts"]) == (1, 1, 2)
    assert found["memory_growth_mb_per_h"] == pytest.approx(2.0)
    assert (found["log_mb_per_h"], found["disk_mb_per_h"]) == pytest.approx((1.0, 4.0))


def test_an_order_that_vanished_and_a_restart_without_a_kill_are_counted() -> None:
    lost = notes()
    lost.waiting.clear()
    lost.restarts |= {"ndt_localization": 1, "touch_ui": 1}
    found = figures(lost)
    assert (found["orders_lost"], found["restarts_unexplained"]) == (1, 2)

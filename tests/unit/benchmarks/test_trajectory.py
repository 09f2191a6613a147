"""The measurement of trajectories, on records of exactly known motions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from tests.benchmarks import trajectory
from tests.benchmarks.support.trajectory_rig import Record

TIMES = np.array([0.0, 0.4, 1.0])
ROWS = np.array([[0.0] * 6, [0.2, 0.1, 0.0, -0.1, 0.3, 0.1], [0.4, -0.1, 0.2, 0.1, 0.1, -0.3]])
SPLINE = CubicSpline(TIMES, ROWS, bc_type="clamped")
BEGIN_S = 5.0123
STAMP_OFFSET_S = 100.0  # monotonic time of engine time 0


def record(lag_s: float = 0.0, until_s: float = 9.0) -> Record:
    """Returns a motion from BEGIN_S, every second cycle sampled. ``until_s``: path time at which it stops."""
    engine_s = np.arange(4.9, 6.5, 0.002)

    def at(time_s: np.ndarray, order: int) -> np.ndarray:
        moving = (time_s > 0.0) & (time_s < min(until_s, TIMES[-1]))
        values = SPLINE(np.clip(time_s, 0.0, min(until_s, TIMES[-1])), order)
        return np.where(moving[:, None], values, 0.0) if order else values

    time_s = engine_s - BEGIN_S
    stamp_ns = np.rint(1e9 * (engine_s + STAMP_OFFSET_S)).astype(np.int64)
    return Record(engine_s, stamp_ns, at(time_s, 0), at(time_s - lag_s, 0), at(time_s, 1), at(time_s - lag_s, 1))


def test_latency_counts_from_sending_to_the_first_commanded_motion() -> None:
    measured = trajectory._Measured()
    trajectory._follow(measured, SPLINE, record(), sent_ns=round(1e9 * (STAMP_OFFSET_S + BEGIN_S - 0.0075)))
    assert measured.start_ms == [pytest.approx(7.5, abs=1e-3)]
    assert measured.tracking_rad == [pytest.approx(0.0, abs=1e-9)]
    assert measured.command_rad == [pytest.approx(0.0, abs=1e-9)]


def test_tracking_error_is_that_of_the_feedback() -> None:
    measured = trajectory._Measured()
    trajectory._follow(measured, SPLINE, record(lag_s=0.005), sent_ns=0)
    fastest = np.abs(SPLINE(np.linspace(0.0, 1.0, 1000), 1)).max()
    assert measured.tracking_rad == [pytest.approx(0.005 * fastest, rel=0.05)]
    assert measured.command_rad == [pytest.approx(0.0, abs=1e-9)]


def test_standstill_counts_until_command_and_joints_stand() -> None:
    measured = trajectory._Measured()
    canceled_ns = round(1e9 * (STAMP_OFFSET_S + BEGIN_S + 0.5))
    trajectory._cancel(measured, SPLINE, record(lag_s=0.02, until_s=0.6), canceled_ns, canceled_ns + 150_000_000)
    assert measured.standstill_ms == [pytest.approx(120.0, abs=4.0)]
    assert measured.canceled_ms == [pytest.approx(150.0)]
    assert measured.off_path_rad == [pytest.approx(0.0, abs=1e-6)]

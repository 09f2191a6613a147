"""The motion between two matches compared with that of the wheels: slip or noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.localization.ndt.matcher import Match, pose_of
from robot_stack.localization.ndt.slip import Slip, SlipWitness
from tests.unit.localization.courtyard import UP
from tests.unit.localization.stories import params

SLIP = params().ndt.slip
PERIOD_S = 0.1


def match_at(x_m: float, y_m: float = 0.0, sigma_m: float = 0.015, yaw_rad: float = 0.0) -> Match:
    pose = pose_of(Pose2(x_m, y_m, yaw_rad), 0.0, UP)
    return Match(pose, np.eye(6) * sigma_m**2, score=0.9, structure=500, converged=True, iterations=5, reversals=0)


def run(seconds: float, seen_mps: float, odometry_mps: float, sigma_m: float = 0.015) -> Slip | None:
    """Returns the last report. The frame of the wheels has another origin and heading."""
    witness, zero = SlipWitness(SLIP), Pose2(40.0, -7.0, 2.0)
    shown = None
    for k in range(round(seconds / PERIOD_S) + 1):
        t_s = k * PERIOD_S
        shown = witness.see(
            100.0 + t_s, match_at(seen_mps * t_s, sigma_m=sigma_m), zero.compose(Pose2(odometry_mps * t_s, 0, 0))
        )
    return shown


def test_spinning_wheels_are_detected_within_two_sweeps() -> None:
    slip = run(0.2, seen_mps=0.0, odometry_mps=1.0)
    assert (slip.stamp_s, slip.over_s) == pytest.approx((100.2, 0.2))
    assert (slip.seen_m, slip.odometry_m, slip.rate_mps) == pytest.approx((0.0, 0.2, 1.0))
    assert str(slip) == "0.20 m by the wheels, 0.00 m by the map in 0.2 s"


def test_sliding_with_wheels_at_rest_is_detected() -> None:
    slip = run(1.0, seen_mps=0.15, odometry_mps=0.0)
    assert slip.seen_m == pytest.approx(0.15)


def test_equal_distances_are_not_detected_as_slip() -> None:
    for speed_mps in (0.0, 0.3, 1.5):
        assert run(3.0, speed_mps, speed_mps) is None
    assert run(3.0, seen_mps=1.5, odometry_mps=1.5 * 1.01) is None  # wrong wheel radii
    assert run(1.0, seen_mps=0.0, odometry_mps=0.5, sigma_m=0.2) is None  # of an unsure match


def test_match_noise_is_not_detected_as_slip() -> None:
    witness, random = SlipWitness(SLIP), np.random.default_rng(3)
    shown = []
    for k in range(2000):
        x_m, y_m = random.normal(0.0, 0.015, 2)
        shown.append(witness.see(k * PERIOD_S, match_at(0.12 * k + x_m, y_m), Pose2(0.12 * k, 0.0, 0.0)))
    assert sum(slip is not None for slip in shown) <= 2  # of 2,000 at more than five standard deviations


def test_slip_window_excludes_older_motion() -> None:
    """A past slip is no longer reported, and motion before a gap does not count after it."""
    witness = SlipWitness(SLIP)
    assert witness.see(0.0, match_at(0.0), IDENTITY) is None
    assert witness.see(0.5, match_at(0.0), Pose2(0.5, 0.0, 0.0)) is not None
    assert witness.see(0.5 + 1.1 * SLIP.window_s, match_at(0.0), Pose2(9.0, 0.0, 0.0)) is None
    witness.clear()
    assert witness.see(0.6 + 1.1 * SLIP.window_s, match_at(5.0), Pose2(9.0, 0.0, 0.0)) is None


def test_dead_reckoning_is_the_farther_off_the_longer_ago_the_match() -> None:
    slip = Slip(stamp_s=10.0, over_s=0.5, seen_m=0.0, odometry_m=0.5, rate_mps=1.0)
    assert slip.off_m(10.2) == pytest.approx(0.2)
    assert slip.off_m(9.0) == 0.0
    assert replace(slip, rate_mps=0.2).off_m(10.2) == pytest.approx(0.04)


def test_slip_rate_is_not_averaged_over_time_before_slip() -> None:
    """The rate is not the mean over a window that lies mostly before the slip."""
    witness = SlipWitness(SLIP)
    for k in range(10):
        assert witness.see(k * PERIOD_S, match_at(0.0), IDENTITY) is None
    slip = witness.see(10 * PERIOD_S, match_at(0.0), Pose2(0.1, 0.0, 0.0))
    assert slip.rate_mps == pytest.approx(1.0)

"""Half sweeps as poses arrive, and the sensor's faults."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim.lidar.faults import KINDS, LidarFaults
from sim.lidar.sensor import CLEAR, Conditions
from sim.lidar.sun import Sun
from sim.lidar.sweeper import Sweeper
from sim.lidar.weather import Weather

from .scenes import exact, lidar, pose, world

COLUMNS = 64


def sweeper() -> Sweeper:
    return Sweeper(lidar(world(), exact(COLUMNS)))


def test_half_sweeps_end_at_even_spaces_whatever_the_poses_do() -> None:
    mine, ends = sweeper(), []
    for k in range(200):
        mine.add(5.0 + 0.02 * k, {"base_link": pose(0.01 * k, 0.0)})
        due = mine.due()
        if due is not None:
            ends.append(due)
            assert due[1] <= 5.0 + 0.02 * k + 1e-3, "never before its last column has fired"
            assert 5.0 + 0.02 * k - due[1] < 0.0102
            half = mine.measure(mine.tracks(), *due)
            assert half.stamp_s == due[1]
            assert math.copysign(1.0, float(np.median(half.points["y"]))) == (1.0 if due[0] % 2 else -1.0)
    assert [number for number, _ in ends] == list(range(1, 80))
    assert np.allclose([end for _, end in ends], 5.0 + 0.05 * np.arange(1, 80))


def test_sweeper_skips_gap_and_restarts_on_clock_set_back() -> None:
    mine = sweeper()
    for k in range(8):
        mine.add(0.02 * k, {"base_link": np.eye(4)})
        mine.due()
    mine.add(1.0, {"base_link": np.eye(4)})
    assert mine.due() == (20, pytest.approx(1.0))
    assert mine.due() is None, "what lay in the gap is gone"
    mine.add(0.5, {"base_link": np.eye(4)})
    assert mine.due() is None
    mine.add(0.55, {"base_link": np.eye(4)})
    assert mine.due() == (1, pytest.approx(0.55))
    with pytest.raises(KeyError):
        mine.add(0.6, {"wheelchair": np.eye(4)})


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_every_fault_has_bounds_and_ends(kind: object) -> None:
    faults = LidarFaults()
    name, low, high, default = kind.name, kind.low, kind.high, kind.default  # type: ignore[attr-defined]
    assert faults.value(name, 0.0) is None
    faults.inject(name, "", 0.0, 2.0, 10.0)
    assert faults.value(name, 11.9) == default
    assert faults.value(name, 12.0) is None
    faults.inject(name, "", high, 0.0, 10.0)
    assert faults.value(name, 1e9) == high
    assert faults.inject("clear", name, 0.0, 0.0, 10.0) == f"cleared {name}"
    for wrong in (high + 1.0, 0.5 * low or -1.0, math.nan, math.inf):
        with pytest.raises(match="value"):
            faults.inject(name, "", wrong, 0.0, 10.0)
    for wrong in (-1.0, math.nan):
        with pytest.raises(match="duration_s"):
            faults.inject(name, "", 0.0, wrong, 10.0)
    with pytest.raises(match="target"):
        faults.inject(name, "left", 0.0, 0.0, 10.0)


def test_faults_make_conditions_and_weather_replaces_the_weather_before() -> None:
    faults = LidarFaults()
    assert faults.conditions(0.0) == CLEAR
    assert faults.inject("rain", "", 0.0, 0.0, 0.0) == "it rains, mm/h 25"
    assert faults.conditions(1.0).weather == Weather("rain", 25.0)
    faults.inject("noisy", "", 3.0, 0.0, 1.0)
    faults.inject("covered", "", 0.5, 0.0, 1.0)
    faults.inject("snow", "", 2.0, 5.0, 1.0)
    assert "a low sun shines in" in faults.inject("sun", "", 0.0, 5.0, 1.0)
    assert faults.conditions(2.0) == Conditions(3.0, 0.5, Weather("snow", 2.0), Sun(360.0))
    assert faults.conditions(6.5) == Conditions(3.0, 0.5)
    for arguments, problem in ((("dust", "", 1.0), "visibility in m"), (("glare", "", 0.0), "no fault 'glare'")):
        with pytest.raises(match=problem):
            faults.inject(*arguments, 0.0, 1.0)
    with pytest.raises(match="no fault 'glare'"):
        faults.inject("clear", "glare", 0.0, 0.0, 0.0)
    assert faults.inject("clear", "", 0.0, 0.0, 0.0) == "cleared noisy, covered"

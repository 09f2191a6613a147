"""Limits that planning, drive and safety monitor share."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.limits import NO_LIMIT, STANDSTILL, MotionLimits, SpeedLimit
from robot_stack.core.robot import load_robot

EMPTY = MotionLimits.of(load_robot().empty)


def test_slower_takes_the_smaller_of_each():
    slower = EMPTY.slower(SpeedLimit(0.3, 5.0))
    assert (slower.speed_mps, slower.yaw_rate_radps) == (0.3, EMPTY.yaw_rate_radps)
    assert slower.acceleration_mps2 == EMPTY.acceleration_mps2
    assert EMPTY.slower(NO_LIMIT) == EMPTY


@pytest.mark.parametrize("limit", [STANDSTILL, SpeedLimit(math.nan, -1.0), SpeedLimit(-math.inf, math.nan)])
def test_invalid_speed_limit_is_standstill(limit: SpeedLimit):
    assert limit.usable() == (0.0, 0.0)
    assert (EMPTY.slower(limit).speed_mps, EMPTY.slower(limit).yaw_rate_radps) == (0.0, 0.0)


@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
def test_speeds_may_be_zero_and_accelerations_not(bad: float):
    for acceleration in (bad, 0.0):
        with pytest.raises(ValueError, match="acceleration_mps2"):
            MotionLimits(0.0, 0.0, acceleration, 1.0, 1.0, 1.0)
    with pytest.raises(ValueError, match="speed_mps"):
        MotionLimits(bad, 1.0, 1.0, 1.0, 1.0, 1.0)
    with pytest.raises(ValueError, match="yaw_rate_radps"):
        MotionLimits(1.0, bad, 1.0, 1.0, 1.0, 1.0)

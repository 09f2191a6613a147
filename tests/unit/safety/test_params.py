"""Invalid parameters are rejected with the name of the field."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pydantic import ValidationError

from robot_stack.contract import faults, topics
from robot_stack.safety.conditions import CONDITIONS
from robot_stack.safety.params import SafetyParams
from tests.unit.safety.story import PARAMS, params

NUMBERS = [name for name, value in PARAMS.model_dump().items() if isinstance(value, float)]


def test_the_shipped_rows_are_all_that_have_a_condition() -> None:
    assert set(PARAMS.rows) == set(CONDITIONS)


def test_the_shipped_numbers_are_the_documented_ones() -> None:
    assert (PARAMS.tilt_stop_deg, PARAMS.slope_limit_deg, PARAMS.slope_stop_deg) == (15.0, 5.0, 10.0)
    assert (PARAMS.slope_limit_mps, PARAMS.degraded_limit_mps) == (0.3, 0.5)
    assert PARAMS.descent.max_speed_mps < PARAMS.slope_limit_mps
    assert (PARAMS.lost_quality, PARAMS.found_quality, PARAMS.pose_jump_m) == (0.3, 0.5, 1.0)
    assert (PARAMS.battery_low, PARAMS.battery_critical) == (0.30, 0.15)
    assert PARAMS.drive_silence_s == 0.1


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0, "fast", None])
def test_a_bad_number_is_refused_by_name(name: str, bad: Any) -> None:
    with pytest.raises(ValidationError) as error:
        params(**{name: bad})
    assert name in str(error.value)


@pytest.mark.parametrize("name", NUMBERS)
def test_a_missing_number_is_refused(name: str) -> None:
    values = PARAMS.model_dump()
    del values[name]
    with pytest.raises(ValidationError, match=name):
        SafetyParams(**values)


@pytest.mark.parametrize("bad", [0.0, -0.1, math.nan, math.inf, topics.OBSTACLES.stale_limit_s])
def test_sight_is_stale_before_its_row_is_raised(bad: float) -> None:
    with pytest.raises(ValidationError, match="sight_stale_s"):
        params(obstacles={**PARAMS.obstacles.model_dump(), "sight_stale_s": bad})


@pytest.mark.parametrize(
    ("rows", "complaint"),
    [
        (("ESTOP_PRESSED", "NO_SUCH"), "NO_SUCH is not a fault of the contract"),
        (("TILT",), "ESTOP_PRESSED must be among the rows"),
        (("ESTOP_PRESSED", "TILT", "TILT"), "TILT is listed twice"),
    ],
)
def test_rows_that_cannot_be(rows: tuple[str, ...], complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        params(rows=rows)


@pytest.mark.parametrize(
    ("names", "complaint"),
    [
        (("nobody",), "nobody is not a process of the contract"),
        (("safety_monitor",), "safety_monitor cannot watch itself"),
        (("ndt_localization", "ndt_localization"), "ndt_localization is listed twice"),
    ],
)
def test_processes_that_cannot_be(names: tuple[str, ...], complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        params(expected_processes=names)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"slope_hysteresis_deg": 5.0}, "slope_hysteresis_deg must be less than slope_limit_deg"),
        ({"slope_limit_deg": 10.0}, "slope_limit_deg must be less than slope_stop_deg"),
        ({"slope_stop_deg": 15.0}, "slope_stop_deg must be less than tilt_stop_deg"),
        (
            {"slope_tolerance_deg": 4.5},
            "with its tolerance and hysteresis must be less than tilt_stop_deg",
        ),
        (
            {"descent": {**PARAMS.descent.model_dump(), "angle_deg": 80.0}},
            "must be less than 90",
        ),
        ({"tilt_clear_deg": 15.0}, "tilt_clear_deg must be less than tilt_stop_deg"),
        ({"imu_min_mps2": 40.0}, "imu_min_mps2 must be less than imu_max_mps2"),
        ({"lost_quality": 0.5}, "lost_quality must be less than found_quality"),
        ({"battery_low": 0.15}, "battery_critical must be less than battery_low"),
        ({"attitude_max_gap_s": 2.0}, "attitude_max_gap_s must be less than attitude_time_constant_s"),
    ],
)
def test_limits_out_of_order(changes: dict[str, float], complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        params(**changes)


def test_every_condition_is_a_row_of_the_contract() -> None:
    assert set(CONDITIONS) <= set(faults.BY_CODE)


def test_fewer_rows_and_processes_are_fine() -> None:
    assert params(rows=("ESTOP_PRESSED",), expected_processes=()).rows == ("ESTOP_PRESSED",)

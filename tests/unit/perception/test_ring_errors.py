"""Rings with constant errors, which no averaging removes, are not kerbs."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.contract import frames
from robot_stack.core.robot import Robot
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from tests.benchmarks.foreign import run
from tests.benchmarks.support.ground_real import FOLDER
from tests.unit.perception.conftest import inside
from tests.unit.perception.scenes import Solid, sweep


def made(robot: Robot, params: PerceptionParams, bias: tuple[float, float]) -> Pipeline:
    """Returns a pipeline for a sensor whose data sheet allows these errors (m, deg) of a ring."""
    own = {"range_bias_m": bias[0], "elevation_bias_deg": bias[1]}
    lidar = robot.range_sensors[frames.LIDAR].model_copy(update=own)
    return Pipeline(robot.model_copy(update={"range_sensors": {frames.LIDAR: lidar}}), params)


def near(pipeline: Pipeline, bias: tuple[float, float], seed: int, *solids: Solid, columns: int = 1200) -> np.ndarray:
    pipeline.forget()
    found = pipeline.scene(sweep(solids, ring_bias=bias, seed=seed, columns=columns), 0.0).obstacles
    return found[np.hypot(found[:, 0], found[:, 1]) < 8.0]


@pytest.mark.parametrize(("bias", "seed"), [((0.01, 0.025), 1), ((0.02, 0.05), 2), ((0.03, 0.1), 1), ((0.03, 0.1), 3)])
def test_level_ground_stays_ground_whatever_the_data_sheet_allows(
    robot: Robot, params: PerceptionParams, bias: tuple[float, float], seed: int
) -> None:
    assert len(near(made(robot, params, bias), bias, seed)) == 0


def test_a_sensor_that_is_worse_than_its_data_sheet_shows_kerbs_that_are_none(
    robot: Robot, params: PerceptionParams
) -> None:
    pipeline, columns = made(robot, params, (0.0, 0.0)), robot.range_sensors[frames.LIDAR].columns
    assert max(len(near(pipeline, (0.03, 0.1), seed, columns=columns)) for seed in range(4)) > 10


@pytest.mark.parametrize("seed", [1, 2])
def test_a_kerb_of_8_cm_is_seen_by_the_robot_s_own_sensor_at_its_worst(
    pipeline: Pipeline, robot: Robot, seed: int
) -> None:
    lidar = robot.range_sensors[frames.LIDAR]
    kerb = Solid((2.5, -3.0, 0.0), (2.65, 3.0, 0.08))
    found = near(pipeline, (lidar.range_bias_m, lidar.elevation_bias_deg), seed, kerb)
    front = inside(found, (2.4, 2.8), (-1.0, 1.0))
    assert len(np.unique(np.round(front[:, 1] / 0.1))) >= 16, "80 % of two metres"


@pytest.mark.skipif(not list(FOLDER.glob("scan_*.bin")), reason=f"no sweeps in {FOLDER}")
def test_foreign_street_recording_matches_the_reference_method() -> None:
    figures = run(repeats=1).figures
    assert figures["phantoms"] <= figures["patchworkpp_phantoms"]
    assert figures["missed_cells_pct"] <= figures["patchworkpp_missed_cells_pct"]

"""With a passenger at 1.0 m/s the robot loses sight: it stands before what it cannot see."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.simulated.stage import Stage, staged


def _perception_dies(stage: Stage) -> None:
    stage.kill("perception_pipeline")


def _lidar_falls_silent(stage: Stage) -> None:
    stage.stack.faults.inject("lidar.silent", duration_s=5.0)


@pytest.mark.parametrize("lose_sight", [_perception_dies, _lidar_falls_silent])
def test_losing_sight_is_a_hard_stop(lose_sight: Callable[[Stage], None]) -> None:
    """0.3 s until the row is raised, a tick, and 0.25 m of braking. Gently it would be 1.6 m."""
    with staged() as stage:
        stage.inject("wheelchair", value=75.0)
        stage.limit.wait(lambda message: "PASSENGER_ONBOARD" in message.reason, "the passenger's limit")
        stage.drive_at(1.0, 30.0)
        lost = stage.at()
        lose_sight(stage)
        stage.wait_safety("DEGRADED", "OBSTACLES_TIMEOUT", 1.0)
        raised = stage.at()
        stage.wait_stands(4.0)
        ways_m = stage.at().distance_to(raised), stage.at().distance_to(lost)
        print(f"{ways_m[0]:.2f} m from the row, {ways_m[1]:.2f} m from the loss")
        assert ways_m[0] < 0.5
        assert ways_m[1] < 0.8
        stage.let_go()

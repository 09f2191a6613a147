"""With a passenger at 1.0 m/s the robot loses sight: it stops within 0.5 m. A single lost sweep has no effect."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from robot_stack.contract.faults import SIGHT_STALE
from tests.simulated.shared import shared
from tests.simulated.stage import Stage, staged

pytestmark = shared(staged)


def _perception_dies(stage: Stage) -> None:
    stage.kill("perception_pipeline")


def _perception_hangs(stage: Stage) -> None:
    stage.hang("perception_pipeline", 3.0)


def _lidar_falls_silent(stage: Stage) -> None:
    stage.stack.faults.inject("lidar.silent", duration_s=5.0)


def _ride_at_1_mps(stage: Stage) -> None:
    """With a passenger, at the steady speed of the limit."""
    stage.inject("wheelchair", value=75.0)
    stage.limit.wait(lambda message: "PASSENGER_ONBOARD" in message.reason, "the passenger's limit")
    stage.drive(1.0)
    stage.wait_faster(0.99)


# The longest way follows a loss right after a half sweep; half sweeps end every 0.05 s.
@pytest.mark.parametrize(
    ("lose_sight", "after_s"),
    [
        (_perception_dies, 0.34),
        (_perception_hangs, 0.32),
        (_lidar_falls_silent, 0.30),
    ],
)
def test_losing_sight_is_a_hard_stop(lose_sight: Callable[[Stage], None], after_s: float) -> None:
    """The limit falls before the row is raised. The row alone would give 0.55 to 0.65 m, a comfort stop 1.6 m."""
    with staged() as stage:
        _ride_at_1_mps(stage)
        stage.run(after_s)
        lost, lost_s = stage.at(), stage.now_s
        lose_sight(stage)
        stage.limit.wait(lambda message: message.reason == SIGHT_STALE, "the limit of what is seen late", 0.3)
        stage.wait_safety("DEGRADED", "OBSTACLES_TIMEOUT", 1.0)
        assert 0.2 < stage.now_s - lost_s < 0.4  # the row's own timeout is unchanged
        stage.wait_stands(4.0)
        way_m = stage.at().distance_to(lost)
        assert way_m < 0.5
        stage.let_go()


def test_lost_half_sweep_does_not_slow_the_robot() -> None:
    with staged() as stage:
        _ride_at_1_mps(stage)
        begun_s = stage.now_s
        for _ in range(3):
            stage.stack.faults.inject("lidar.silent", duration_s=0.05)
            stage.stays(lambda: stage.speed_mps > 0.95, "the speed is kept", 0.4)
        assert not [message for message in stage.limit.since(begun_s) if SIGHT_STALE in message.reason]
        stage.let_go()

"""The latch opens while a wheelchair is carried: afterwards only an undocking may move the robot."""

from __future__ import annotations

import math

from robot_stack.core.geometry import Pose2
from tests.simulated.shared import shared
from tests.simulated.stage import Stage, docked

START = Pose2(0.2, 0.3, math.radians(10.0))
pytestmark = shared(docked, START)


def lose_the_chair(stage: Stage) -> None:
    """Opens the latch at 0.4 m/s, then performs both release steps."""
    stage.drive(-0.4)
    stage.wait_faster(0.35)
    stage.inject("latch_opens")
    stage.wait_safety("EMERGENCY_STOP", "CHAIR_LOOSE")
    stage.wait_stands(5.0)
    stage.drive(0.0)
    stage.release()
    stage.wait_safety("DEGRADED", "LATCH_NOT_CLOSED")


def test_after_the_reset_the_robot_does_not_drive_with_a_loose_chair() -> None:
    with docked(START) as stage:
        lose_the_chair(stage)
        stage.run(0.5)
        stage.drive(1.0)
        stage.assert_wheels_rest(5.0)
        assert stage.limit.last.max_linear_velocity == 0.0
        assert stage.passenger.last.data is True


def test_undocking_leaves_a_loose_chair_at_creep_speed() -> None:
    with docked(START) as stage:
        lose_the_chair(stage)
        stage.let_go()
        before = stage.at()
        goal = stage.begin_undocking()
        fastest_mps = 0.0
        while goal.result is None:
            stage.run(0.05)
            fastest_mps = max(fastest_mps, stage.speed_mps)
        assert goal.result.success, goal.result.reason
        assert 0.05 < fastest_mps < 0.16
        assert stage.at().distance_to(before) > 0.45
        stage.run(0.5)
        assert stage.passenger.last.data is False
        assert "EMERGENCY_STOP" not in stage.safety_states(stage.now_s - 1.0)
        stage.wait_safety("NORMAL")

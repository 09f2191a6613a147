"""After any stop on a slope the robot can drive off; above the limit only downhill. In physics."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot_stack.core.geometry import IDENTITY, Pose2
from tests.simulated.stage import Stage, staged
from tests.support.environment import own_config

# West of ramp_10 of config/worlds/yard.yaml: up from x = -2.0 to 0.84 m along y = -6.5 m. The mapping ride left it out,
# so the site's map shows it as an obstacle, and only teleoperation can drive there.
BESIDE_YARD_RAMP = Pose2(-3.6, -6.5, 0.0)
# Before ramp_10 of config/worlds/ramps.yaml: up from x = 3.0 to 6.4 m, down from 9.4 to 12.8 m, along y = 4.5 m.
BEFORE_RAMP = Pose2(2.2, 4.5, 0.0)
MISSION = """
id: over_the_ramp
name: {en: Over the ramp, ja: 坂越え, zh: 过坡}
home: {x: 2.2, y: 4.5, yaw: 0.0}
waypoints:
  - {name: behind the ramp, x: 14.5, y: 4.5, yaw: 0.0, action: park}
"""
# ramp_13 of config/worlds/steep_ramp.yaml rises from here.
STEEP_FOOT_X_M = 1.5


def _stop_and_release(stage: Stage) -> None:
    stage.estop(True)
    stage.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
    stage.wait_stands(5.0)
    stage.let_go()  # a stick that is still held would be ignored after the release
    stage.release()
    stage.wait_safety("DEGRADED", "SLOPE")


def _resume(stage: Stage) -> None:
    stage.wait_mission("PAUSED")
    stage.run(0.5)  # until mission_manager has received the release
    stage.command("RESUME")
    stage.wait_mission("RUNNING")


def _is_refused(stage: Stage) -> bool:
    return bool(stage.limit.last.max_linear_velocity == 0.0 and stage.limit.last.reason == "SLOPE")


def _stays(stage: Stage) -> None:
    """The robot must not move, whatever is requested."""
    before_m = stage.at().x
    stage.run(2.0)
    assert stage.stands
    assert abs(stage.at().x - before_m) < 0.01


def test_a_robot_stopped_on_the_ramp_of_the_yard_is_driven_off_by_hand_up_and_down() -> None:
    with staged("yard", start=BESIDE_YARD_RAMP) as stage:
        stage.drive(0.5)
        stage.wait(lambda: stage.z_m > 0.20, "half way up the ramp", 30.0)
        _stop_and_release(stage)
        for vx_mps, goal_m in ((-0.5, -1.2), (0.5, -0.8)):
            stage.drive(vx_mps)
            stage.wait(lambda goal_m=goal_m, vx_mps=vx_mps: (stage.at().x - goal_m) * vx_mps > 0.0, "the place", 40.0)
            assert stage.speed_mps < 0.33
            _stop_and_release(stage)
        stage.let_go()


def test_mission_stopped_on_a_ramp_continues_after_resume(tmp_path: Path) -> None:
    with own_config(tmp_path, over_the_ramp=MISSION), staged("ramps", start=BEFORE_RAMP) as stage:
        stage.command("START_MISSION", "over_the_ramp")
        stage.wait_mission("RUNNING")
        stage.wait(lambda: stage.z_m > 0.25, "half way up the ramp", 40.0)
        _stop_and_release(stage)
        _stays(stage)  # until RESUME
        _resume(stage)
        stage.wait(lambda: stage.z_m > 0.58, "the top of the ramp", 60.0)
        # From 1.5 m/s at the top it brakes at 1 m/s2 once the slope is measured: 1.5 m of way, 0.26 m of height.
        stage.wait(lambda: stage.z_m < 0.30, "half way down the other side", 40.0)
        assert stage.speed_mps < 0.33
        _stop_and_release(stage)
        _resume(stage)
        stage.wait(lambda: stage.z_m < 0.20, "going on downhill", 20.0)


def test_above_the_limit_the_robot_stops_and_may_only_go_downhill() -> None:
    """By hand, and by navigation without help."""
    with staged("steep_ramp", start=IDENTITY) as stage:
        start_m = stage.at().x
        stage.drive(0.5)
        stage.wait(lambda: _is_refused(stage), "the ramp is too steep", 40.0)
        stage.wait_stands(5.0)
        assert stage.at().x > STEEP_FOOT_X_M
        _stays(stage)  # the request still points uphill
        _stop_and_release(stage)
        for twist in ((0.3, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.5)):
            stage.drive(*twist)
            _stays(stage)
        stage.drive(-0.5)
        stage.wait_faster(0.15)
        assert stage.limit.last.max_linear_velocity == pytest.approx(0.2)
        stage.let_go()
        stage.wait_stands(5.0)
        assert stage.limit.last.reason == "SLOPE"
        stage.go(Pose2(start_m, 0.0, 0.0))
        stage.wait(lambda: stage.at().x < start_m + 0.3 and stage.stands, "navigation comes down the ramp", 60.0)
        stage.wait_safety("NORMAL")

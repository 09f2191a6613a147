"""The safety edge is touched: the engine stops, the safety monitor latches it, and people end it."""

from __future__ import annotations

from typing import Any

import pytest

from robot_stack.core.geometry import IDENTITY
from tests.simulated.shared import shared
from tests.simulated.stage import Stage, staged, staged_before_chair


def engine_stopped(stage: Stage) -> bool:
    return bool(stage.world.engine.engine.condition.emergency_stop)


def contact_of(stage: Stage) -> Any:
    return stage.wait_safety("EMERGENCY_STOP", "CONTACT", 1.0)


def test_a_wheelchair_that_meets_the_robot_is_a_contact_until_it_is_taken_away() -> None:
    """A person pushes the chair against the latch's plates of the standing robot."""
    with staged_before_chair(IDENTITY) as stage:
        stage.inject("chair_moved", "-1.53,0.0,0.0")
        contact_of(stage)
        assert engine_stopped(stage)
        assert 0.0 < stage.world.sim.world.contact_force_n() < 60.0
        stage.run(1.0)
        stage.drive(-0.3)
        stage.assert_wheels_rest(2.0)
        answer = stage.reset()
        assert not answer.success
        assert "CONTACT: safety edge pressed: front" in answer.message
        stage.drive(0.0)
        stage.inject("chair_moved", "0.60,0.0,0.0")
        stage.run(1.0)
        assert "CONTACT" in stage.safety.last.active_faults, "a free edge alone releases nothing"
        assert engine_stopped(stage)
        stage.release()
        stage.wait_safety("NORMAL")
        stage.let_go()
        stage.drive(-0.2)
        stage.wait_faster(0.15)
        assert not engine_stopped(stage)


@shared(staged)
@pytest.mark.parametrize("target", ["left", "relay"])
def test_a_cut_wire_stops_the_robot_and_refuses_the_reset(target: str) -> None:
    with staged() as stage:
        stage.drive_at(0.4)
        stage.inject("edge_wire_cut", target)
        contact_of(stage)
        assert engine_stopped(stage)
        stage.wait_stands(1.0)
        stage.drive(0.0)
        stage.run(1.0)
        assert f"{target}" in stage.reset().message
        assert not stage.reset().success
        stage.inject("clear", f"edge_wire_cut:{target}")
        stage.release()
        stage.wait_safety("NORMAL")
        stage.let_go()
        stage.drive(0.3)
        stage.wait_faster(0.2)


@shared(staged)
def test_an_edge_pressed_in_motion_stops_the_robot_by_the_engine_alone() -> None:
    """All processes that could stop the robot hang: only the relay's input of the engine is left."""
    with staged() as stage:
        stage.drive_at(0.4)
        for name in ("safety_monitor", "swerve_hardware_interface"):
            stage.hang(name, 2.0)
        stage.inject("edge_pressed", "rear")
        stage.run(0.02)
        assert engine_stopped(stage)
        stage.wait_stands(0.4)

"""The engine in the caller's process drives the physics through the same API as in its own process."""

from __future__ import annotations

import pytest

from robot_stack.contract.frames import DRIVE_AXES, STEER_AXES
from robot_stack.wmx.api import ErrorCode
from robot_stack.wmx.api.values import Motion_PosCommand, Profile, Velocity_VelCommand
from robot_stack.wmx.config import load_engine_config
from sim.plant.local_engine import LocalEngine
from sim.plant.simulation import Simulation
from sim.plant.world import Setup
from sim.worldfile import load_world

from .bench import PARAMS, ROBOT


@pytest.fixture
def ready() -> tuple[LocalEngine, Simulation]:
    """An engine with the bus up and all servos on."""
    file = load_world("flat")
    sim = Simulation(ROBOT, PARAMS, Setup(file, 1, file.start.pose()))
    engine = LocalEngine(load_engine_config(), sim)
    engine.start()
    for axis in range(8):
        assert engine.core_motion.axisControl.SetServoOn(axis, 1) == ErrorCode.PyNone
    for _ in range(200):
        sim.step()
    assert engine.status().servo_on.all()
    return engine, sim


def velocity(axis: int, speed: float, acc: float = 12.0) -> Velocity_VelCommand:
    return Velocity_VelCommand(axis, Profile.SetupTrapezoidal(speed, acc, acc))


def test_wheels_turn_by_velocity_commands_and_stop(ready: tuple[LocalEngine, Simulation]) -> None:
    engine, sim = ready
    commands = [velocity(axis, 0.5 / ROBOT.wheel_radius_m) for axis in DRIVE_AXES]
    assert engine.core_motion.velocity.StartVel(4, commands) == ErrorCode.PyNone
    for _ in range(1500):
        sim.step()
    assert sim.world.truth().linear_mps[0] == pytest.approx(0.5, abs=0.01)
    assert engine.core_motion.ExecEStop(1) == ErrorCode.PyNone
    for _ in range(600):
        sim.step()
    assert abs(sim.world.truth().linear_mps[0]) < 0.01


def test_modules_turn_by_position_commands(ready: tuple[LocalEngine, Simulation]) -> None:
    engine, sim = ready
    profile = Profile.SetupTrapezoidal(4.0, 40.0, 40.0)
    commands = [Motion_PosCommand(axis, 1.2, profile) for axis in STEER_AXES]
    assert engine.core_motion.motion.StartPos(4, commands) == ErrorCode.PyNone
    before = sim.time_s
    while engine.status().op_state[list(STEER_AXES)].any():
        sim.step()
    assert 0.3 < sim.time_s - before < 1.0, "1.2 rad at 4 rad/s and 40 rad/s2: 0.4 s"
    for _ in range(200):
        sim.step()
    assert engine.status().actual_pos[list(STEER_AXES)] == pytest.approx([1.2] * 4, abs=0.005)


def test_bus_loss_ends_communication(ready: tuple[LocalEngine, Simulation]) -> None:
    engine, sim = ready
    sim.world.drives.set_bus(False)
    for _ in range(50):
        sim.step()
    assert not engine.status().communicating
    assert not engine.status().input_bit(ROBOT.estop_input_byte, ROBOT.estop_input_bit), "a lost bus reads as pressed"

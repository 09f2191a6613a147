"""The latch through its I/O: catching range, drawing in, holding, and that only its output opens it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from robot_stack.wmx.api import ErrorCode, EStopLevel
from robot_stack.wmx.config import load_engine_config
from sim.plant.local_engine import LocalEngine
from sim.plant.simulation import Simulation
from sim.plant.world import Setup, World
from sim.worldfile import load_world

from .bench import PARAMS, ROBOT, Bench

LATCH, TIMES = ROBOT.latch, PARAMS.latch
CLOSE, OPEN = 1 << LATCH.close_output_bit, 1 << LATCH.open_output_bit
DOCK_POSE = load_docks().docks["chair_1"].dock_pose.pose()
CHAIR = DOCK_POSE.inverse()  # the chair's pose with the robot docked at the map's origin
MARGIN_S = 0.01


def setup(start: Pose2 = IDENTITY, passenger_kg: float = 75.0, slope_deg: float = 0.0, towards: float = 0.0) -> Setup:
    """Displaces the robot from its dock pose by ``start``, in the chair's frame."""
    return Setup(
        load_world("flat"),
        1,
        start,
        wheelchair_pose=CHAIR,
        passenger_mass_kg=passenger_kg,
        slope_rad=math.radians(slope_deg),
        slope_direction_rad=towards,
    )


def make(start: Pose2 = IDENTITY, passenger_kg: float = 75.0, slope_deg: float = 0.0, towards: float = 0.0) -> Bench:
    bench = Bench(World(ROBOT, PARAMS, setup(start, passenger_kg, slope_deg, towards)))
    bench.run(0.01)
    return bench


def put(bench: Bench, outputs: int, duration_s: float) -> None:
    bench.out.outputs[LATCH.byte] = outputs
    bench.run(duration_s)


def inputs(bench: Bench) -> tuple[bool, bool]:
    """Returns (closed, open)."""
    value = int(bench.inp.inputs[LATCH.byte])
    return bool(value >> LATCH.closed_input_bit & 1), bool(value >> LATCH.open_input_bit & 1)


def latched(passenger_kg: float = 75.0, slope_deg: float = 0.0, towards: float = 0.0) -> Bench:
    bench = make(IDENTITY, passenger_kg, slope_deg, towards)
    put(bench, CLOSE, TIMES.travel_s + TIMES.draw_in_s + MARGIN_S)
    assert inputs(bench) == (True, False)
    return bench


@pytest.fixture
def engine() -> LocalEngine:
    """An engine whose bus is up, with the robot docked and the latch open."""
    made = LocalEngine(load_engine_config(), Simulation(ROBOT, PARAMS, setup()))
    made.start()
    return made


def run(engine: LocalEngine, duration_s: float) -> None:
    for _ in range(round(duration_s / engine._sim.world.dt_s)):
        engine._sim.step()


def held(engine: LocalEngine) -> bool:
    return engine._sim.world.attached


def bits(engine: LocalEngine) -> tuple[int, int]:
    """Returns (closed, open) as a client of the engine reads them."""
    snapshot = engine.status()
    closed, opened = (snapshot.input_bit(LATCH.byte, bit) for bit in (LATCH.closed_input_bit, LATCH.open_input_bit))
    return int(closed), int(opened)


def test_the_engines_io_closes_and_opens_it(engine: LocalEngine) -> None:
    io = engine.io
    assert bits(engine) == (0, 1)
    assert io.SetOutBit(LATCH.byte, LATCH.close_output_bit, 1) == ErrorCode.PyNone
    run(engine, 0.5 * TIMES.travel_s)
    assert bits(engine) == (0, 0), "on its way"
    assert not held(engine)
    run(engine, 0.5 * TIMES.travel_s + MARGIN_S)
    assert held(engine)
    assert bits(engine) == (0, 0), "caught, not yet drawn in"
    run(engine, TIMES.draw_in_s + MARGIN_S)
    assert bits(engine) == (1, 0)
    io.SetOutBit(LATCH.byte, LATCH.close_output_bit, 0)
    run(engine, 0.2)
    assert bits(engine) == (1, 0), "self-holding"
    io.SetOutBit(LATCH.byte, LATCH.open_output_bit, 1)
    run(engine, 0.5 * TIMES.travel_s)
    assert bits(engine) == (0, 0)
    assert held(engine), "held until the hooks are open"
    run(engine, 0.5 * TIMES.travel_s + MARGIN_S)
    assert bits(engine) == (0, 1)
    assert not held(engine)


@pytest.mark.parametrize(
    ("passenger_kg", "slope_deg", "towards"),
    [(75.0, 0.0, 0.0), (120.0, 3.0, math.pi), (120.0, 3.0, 0.5 * math.pi)],
)
def test_it_draws_in_softly_to_the_dock_pose(passenger_kg: float, slope_deg: float, towards: float) -> None:
    """From 8 mm, -7 mm, 0.8 deg to within 0.3 mm and 0.05 deg, without a jolt for the passenger."""
    bench = make(Pose2(0.008, -0.007, math.radians(0.8)), passenger_kg, slope_deg, towards)
    chair = bench.world.model.joint("wheelchair").dofadr[0]
    speeds: list[np.ndarray] = []
    bench.out.outputs[LATCH.byte] = CLOSE
    bench.run(1.0, lambda: speeds.append(bench.world.data.qvel[chair : chair + 3].copy()))
    assert inputs(bench) == (True, False)
    along, across, yaw = bench.world.dock_error(DOCK_POSE)
    assert max(abs(along), abs(across)) < 0.3e-3
    assert abs(yaw) < math.radians(0.05)
    # Mean acceleration over 10 ms, as a person feels no shorter peaks. 10 mm in 0.3 s by a cosine takes 0.55 m/s2.
    jolt = np.abs(np.array(speeds[10:]) - np.array(speeds[:-10])).max() / 0.01
    assert jolt < 1.5


@pytest.mark.parametrize(
    ("off", "catches"),
    [
        (Pose2(0.0095, 0.0, 0.0), True),
        (Pose2(0.0105, 0.0, 0.0), False),
        (Pose2(-0.0105, 0.0, 0.0), False),
        (Pose2(0.0, 0.0095, 0.0), True),
        (Pose2(0.0, -0.0105, 0.0), False),
        (Pose2(0.0, 0.0, math.radians(0.95)), True),
        (Pose2(0.0, 0.0, math.radians(-1.05)), False),
    ],
)
def test_it_catches_within_10_mm_and_1_degree(off: Pose2, catches: bool) -> None:
    bench = make(off)
    put(bench, CLOSE, TIMES.travel_s + TIMES.draw_in_s + 0.1)
    assert bench.world.attached is catches
    assert inputs(bench) == (catches, False)
    if not catches:
        assert bench.world.dock_error(DOCK_POSE) == pytest.approx((off.x, off.y, off.yaw), abs=1e-4)
    put(bench, OPEN, TIMES.travel_s + MARGIN_S)
    assert inputs(bench) == (False, True)
    assert not bench.world.attached


def test_closed_on_nothing_it_catches_nothing_that_comes_later() -> None:
    bench = make(Pose2(-0.05, 0.0, 0.0))
    put(bench, CLOSE, TIMES.travel_s + MARGIN_S)
    bench.world.move_wheelchair(-0.05, 0.0, 0.0)
    put(bench, CLOSE, 0.8)
    assert abs(bench.world.dock_error(DOCK_POSE)[0]) < 1e-3
    assert inputs(bench) == (False, False)
    put(bench, OPEN, TIMES.travel_s + MARGIN_S)
    put(bench, CLOSE, 0.8)
    assert inputs(bench) == (True, False)
    alone = Bench(World(ROBOT, PARAMS, Setup(load_world("flat"), 1, IDENTITY)))
    put(alone, CLOSE, 0.8)
    assert inputs(alone) == (False, False)


@pytest.mark.parametrize("outputs", [0, CLOSE | OPEN])
def test_without_one_clear_command_it_stays_as_it_is(outputs: int) -> None:
    bench = make()
    put(bench, outputs, 0.8)
    assert inputs(bench) == (False, True)
    put(bench, CLOSE, 0.5 * TIMES.travel_s)
    put(bench, outputs, 0.8)
    assert inputs(bench) == (False, False), "half way it stays half way"
    put(bench, CLOSE, 0.5 * TIMES.travel_s + TIMES.draw_in_s + MARGIN_S)
    put(bench, outputs, 0.8)
    assert inputs(bench) == (True, False)


def stop_engine(engine: LocalEngine) -> None:
    engine.engine.stop_engine()


def cut_bus(engine: LocalEngine) -> None:
    engine._sim.world.drives.set_bus(False)


def emergency_stop(engine: LocalEngine) -> None:
    engine.core_motion.ExecEStop(EStopLevel.Final)


def stall(engine: LocalEngine) -> None:
    engine._sim.engine_stalled = True


@pytest.mark.parametrize("trouble", [stop_engine, cut_bus, emergency_stop, stall])
def test_trouble_drops_no_chair(engine: LocalEngine, trouble: Callable[[LocalEngine], None]) -> None:
    engine.io.SetOutBit(LATCH.byte, LATCH.close_output_bit, 1)
    run(engine, 1.0)
    assert bits(engine) == (1, 0)
    engine.io.SetOutBit(LATCH.byte, LATCH.close_output_bit, 0)
    trouble(engine)
    run(engine, 1.0)
    assert held(engine)
    assert engine._sim.world.latch.closed
    if trouble is cut_bus:
        status = engine.status()
        assert not status.communicating
        assert not status.input_bit(ROBOT.estop_input_byte, ROBOT.estop_input_bit), "a lost bus reads as pressed"


def test_latch_stays_closed_if_bus_is_lost_during_opening() -> None:
    """The last telegram requested open. The terminal then drops its outputs, and the hooks stay in place."""
    bench = latched()
    bench.out.outputs[LATCH.byte] = OPEN
    bench.run(0.05)
    bench.talking = False
    bench.run(1.0)
    assert bench.world.attached


def test_it_opens_under_load_and_the_chair_stands() -> None:
    """120 kg on a 3 deg slope pull on the hooks. After the release the parking brake holds the chair."""
    bench = latched(120.0, 3.0, math.pi)
    bench.servo()
    put(bench, OPEN, TIMES.travel_s + MARGIN_S)
    assert inputs(bench) == (False, True)
    before = bench.world.wheelchair_pose()
    bench.run(1.0)
    after = bench.world.wheelchair_pose()
    assert before is not None
    assert after is not None
    assert np.linalg.norm(after[:3, 3] - before[:3, 3]) < 1e-3


def test_the_latched_chair_rolls_with_the_robot_and_the_released_one_stays() -> None:
    bench = latched()
    bench.servo()
    bench.drive(Twist2(0.3, 0.0, 0.0))
    bench.run(1.0)
    assert bench.twist().vx == pytest.approx(0.3, abs=0.01)
    assert bench.world.dock_error(DOCK_POSE) == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    bench.ramp(0.0, 0.5)
    put(bench, OPEN, 0.5)
    bench.drive(Twist2(-0.3, 0.0, 0.0))
    bench.run(1.0)
    assert bench.world.dock_error(DOCK_POSE)[0] < -0.3

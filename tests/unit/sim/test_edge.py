"""The safety edge in the physics, with the engine that it stops and no other client."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.core.geometry import IDENTITY, Twist2
from robot_stack.core.robot import SIDES
from robot_stack.drive.kinematics import ModuleSetPoints
from robot_stack.wmx.api import CoreMotionErrorCode
from sim.plant.rig import Rig
from sim.plant.world import Setup
from sim.worldfile import Box, load_world

from .bench import PARAMS, ROBOT, wheels

EDGE = ROBOT.safety_edge
assert EDGE is not None
FRONT_M, HALF_M = ROBOT.footprint.front_m, 0.5 * ROBOT.footprint.width_m
DIRECTIONS = {"front": (1.0, 0.0), "rear": (-1.0, 0.0), "left": (0.0, 1.0), "right": (0.0, -1.0)}


def rig_before_box(side: str, speed_mps: float) -> Rig:
    """A rig whose way to ``side`` ends at a fixed box, far enough to reach the speed at 1 m/s2."""
    run_up_m = 0.05 + speed_mps**2 / 2.0
    along, across = DIRECTIONS[side]
    away_m = (FRONT_M if along else HALF_M) + run_up_m + 0.5
    box = Box(name="box", x_m=along * away_m, y_m=across * away_m, length_m=1.0, width_m=1.0, height_m=1.0)
    world = load_world("flat").model_copy(update={"boxes": (box,)})
    return Rig(ROBOT, PARAMS, Setup(world, 1, IDENTITY, wheelchair=False))


def drive_until_stopped(rig: Rig, side: str, speed_mps: float) -> tuple[float, float]:
    """Commands the speed again and again, as a client that ignores the stop. Largest force N and deformation m."""
    x, y = DIRECTIONS[side]
    speeds, angles = wheels(Twist2(x * speed_mps, y * speed_mps, 0.0))
    signs = np.sign(speeds)
    edge = rig.sim.world.edge
    assert edge is not None
    force_n = depth_m = reached_mps = 0.0
    for tick in range(400):
        ramp_mps = min(speed_mps, 0.02 * max(0, tick - 40))
        rig.command(ModuleSetPoints(tuple(signs * ramp_mps), tuple(angles)))
        for _ in range(20):
            rig.sim.step()
            force_n = max(force_n, edge.force_n)
            depth_m = max(depth_m, edge.deformation_m[side])
            reached_mps = max(reached_mps, math.hypot(*rig.sim.world.truth().linear_mps[:2]))
        if rig.engine.status().emergency_stop and tick > 100 and edge.force_n:
            break
    assert reached_mps == pytest.approx(speed_mps, rel=0.1)
    return force_n, depth_m


@pytest.mark.parametrize("side", SIDES)
def test_at_docking_speed_the_edge_stops_the_engine_with_less_than_30_n(side: str) -> None:
    rig = rig_before_box(side, 0.03)
    force_n, _ = drive_until_stopped(rig, side, 0.03)
    assert 0.0 < force_n < 30.0
    assert rig.engine.status().emergency_stop
    assert rig.engine.core_motion.ReleaseEStop() == CoreMotionErrorCode.EmergencyStopSignalOn, "still pressed"
    rig.sim.world.move_robot(*(-0.05 * part for part in DIRECTIONS[side]), 0.0)
    for _ in range(50):
        rig.sim.step()
    assert rig.engine.status().emergency_stop, "free alone releases nothing"
    assert rig.engine.core_motion.ReleaseEStop() == 0


@pytest.mark.parametrize("side", ["front", "left"])
def test_at_creep_speed_the_robot_stands_within_the_travel(side: str) -> None:
    rig = rig_before_box(side, 0.3)
    _, depth_m = drive_until_stopped(rig, side, 0.3)
    assert EDGE is not None
    assert depth_m < EDGE.travel_m

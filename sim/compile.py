"""Compiles the inner loops of the stack and its simulation for later starts: ``python -m sim.compile``."""

from __future__ import annotations

import numpy as np

from robot_stack.core.config import load
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import IDENTITY
from robot_stack.core.robot import load_robot
from robot_stack.costmap.costmap import LocalCostmap
from robot_stack.costmap.params import CostmapParams
from robot_stack.docking.vision.detector import MarkerDetector
from robot_stack.docking.vision.params import ArucoDetectorParams
from robot_stack.localization.ndt import solver
from robot_stack.navigation import warm_up as navigation
from robot_stack.navigation.params import NavigationParams
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from robot_stack.wmx.config import EngineConfig, load_engine_config
from robot_stack.wmx.simulated.engine import Engine
from sim.arm.params import ArmParams
from sim.arm.world import ArmWorld
from sim.lidar.views import sweep_at
from sim.parameters import load_sim_params
from sim.simulation import Simulation
from sim.world import Setup
from sim.worldfile import load_world

_CYCLES = 10


def compile_loops() -> None:
    """What the loops call is compiled and kept on disk."""
    _simulation()
    _arm()
    robot = load_robot()
    MarkerDetector(load_docks(), load(ArucoDetectorParams, "aruco_detector").detector).warm_up()
    Pipeline(robot, load(PerceptionParams, "perception_pipeline")).warm_up()
    LocalCostmap(load(CostmapParams, "costmap_server"), robot).warm_up()
    solver.warm_up()
    navigation.warm_up(load(NavigationParams, "navigation_controller"), robot)


def _simulation() -> None:
    """A few cycles of the whole world, and one look around with the LiDAR."""
    world = load_world("flat")
    simulation = Simulation(load_robot(), load_sim_params(), Setup(world, seed=0, start=IDENTITY))
    simulation.engine_cycle = Engine(load_engine_config(), simulation.world.drives).cycle
    for _ in range(_CYCLES):
        simulation.step()
    sweep_at(world, np.eye(4))


def _arm() -> None:
    """A few cycles of the arm's drives."""
    config = load(EngineConfig, "wmx_engine_manipulator")
    arm = ArmWorld(load(ArmParams, "sim_manipulator"), config.cycle_time_s)
    for _ in range(_CYCLES):
        arm.step()


if __name__ == "__main__":
    compile_loops()

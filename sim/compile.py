"""Compiles the inner loops of engine, drives and marker detector for later starts: ``python -m sim.compile``."""

from __future__ import annotations

from robot_stack.core.config import load
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import IDENTITY
from robot_stack.core.robot import load_robot
from robot_stack.docking.vision.detector import MarkerDetector
from robot_stack.docking.vision.params import ArucoDetectorParams
from robot_stack.wmx.config import load_engine_config
from robot_stack.wmx.simulated.engine import Engine
from sim.parameters import load_sim_params
from sim.simulation import Simulation
from sim.world import Setup
from sim.worldfile import load_world

_CYCLES = 10


def compile_loops() -> None:
    """A few cycles of the whole simulation: what they call is compiled and kept on disk."""
    simulation = Simulation(load_robot(), load_sim_params(), Setup(load_world("flat"), seed=0, start=IDENTITY))
    simulation.engine_cycle = Engine(load_engine_config(), simulation.world.drives).cycle
    for _ in range(_CYCLES):
        simulation.step()
    MarkerDetector(load_docks(), load(ArucoDetectorParams, "aruco_detector").detector).warm_up()


if __name__ == "__main__":
    compile_loops()

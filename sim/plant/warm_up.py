"""Compiles the kernels of the robot's servo drives, or loads them."""

from __future__ import annotations

import numpy as np

from robot_stack.core.robot import load_robot
from robot_stack.wmx.bus import DriveCommands, DriveFeedback
from sim.params import load_sim_params
from sim.plant.drive_loops import JointIndex
from sim.plant.drives import N_AXES, ServoDrives
from sim.plant.robot_model import nominal_tolerances

_BYTES = 1  # of inputs and outputs


def warm_up() -> None:
    """One cycle of standing wheels."""
    robot, params = load_robot(), load_sim_params()
    random, cycle_s = np.random.default_rng(0), params.physics.timestep_s
    drives = ServoDrives(robot, params, nominal_tolerances(robot), cycle_s, random)
    axes, standing = np.arange(N_AXES), np.zeros(N_AXES)
    drives.exchange(DriveCommands.zeros(drives.n_axes, _BYTES), DriveFeedback.zeros(drives.n_axes, _BYTES))
    drives.step(standing, standing, JointIndex(axes, axes), np.zeros(N_AXES), np.zeros(N_AXES))

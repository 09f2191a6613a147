"""Compiles the kernels of the arm's drives, or loads them."""

from __future__ import annotations

import numpy as np

from robot_stack.core.config import load
from sim.arm.drives import ArmDrives
from sim.arm.params import N_JOINTS, ArmParams
from sim.plant.drive_loops import JointIndex

_CYCLE_S = 0.001


def warm_up() -> None:
    """One cycle of standing joints."""
    drives, joints = ArmDrives(load(ArmParams, "sim_manipulator"), _CYCLE_S), np.arange(N_JOINTS)
    index, standing = JointIndex(joints, joints), np.zeros(N_JOINTS)
    drives.begin(standing, index)
    drives.step(standing, standing, index, np.zeros(N_JOINTS), np.zeros(N_JOINTS))

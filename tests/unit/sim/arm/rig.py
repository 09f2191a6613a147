"""The arm on a bus that a test serves: commands in rad at the joints, as an engine would send them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.config import load
from robot_stack.wmx.bus import DriveCommands, DriveFeedback
from sim.arm.params import N_JOINTS, ArmParams
from sim.arm.world import ArmWorld

Row = NDArray[np.float64]
DT_S = 0.001
STRETCHED = (0.0, math.pi / 2, 0.0, 0.0, 0.0, 0.0)


def arm_params(**changes: Any) -> ArmParams:
    return load(ArmParams, "sim_manipulator").model_copy(update=changes)


class ArmRig:
    """An arm and its bus master."""

    def __init__(self, **changes: Any) -> None:
        self.params = arm_params(**changes)
        self.arm = ArmWorld(self.params, DT_S)
        kinds = [self.params.kind(axis) for axis in range(N_JOINTS)]
        directions = np.array([joint.direction for joint in self.params.joints])
        self._counts_per_rad = directions * np.array([kind.encoder_counts_per_rev for kind in kinds]) / (2.0 * math.pi)
        self.rated_nm = np.array([kind.rated_torque_nm for kind in kinds])
        self.out = DriveCommands.zeros(N_JOINTS, 8)
        self.inp = DriveFeedback.zeros(N_JOINTS, 8)
        self.worst = np.zeros(N_JOINTS)
        self.connected = True
        self.cycle()
        self.command(self.positions)

    def cycle(self) -> None:
        self.connected = self.arm.bus.exchange(self.out, self.inp)
        self.arm.step()

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / DT_S)):
            self.cycle()

    def command(self, positions: Row, speeds: Row | float = 0.0) -> None:
        self.out.position_counts[:] = np.rint(positions * self._counts_per_rad)
        self.out.velocity_counts_per_s[:] = speeds * self._counts_per_rad

    def on(self) -> ArmRig:
        """Switches the servos on at the arm's current position."""
        self.out.servo_on[:] = True
        self.run(0.15)
        assert self.inp.servo_on.all()
        return self

    def follow(self, path: Any, seconds: float) -> None:
        """Sends path(t) and path(t, 1), rad and rad/s, each cycle; ``worst`` holds the largest following errors."""
        self.worst[:] = 0.0
        for step in range(1, round(seconds / DT_S) + 1):
            wanted = path(step * DT_S)
            self.command(wanted, path(step * DT_S, 1))
            self.cycle()
            np.maximum(self.worst, np.abs(wanted - self.positions), out=self.worst)

    def go(self, goal: Row, seconds: float) -> None:
        """Moves to ``goal`` along a cubic, followed by 0.2 s of rest."""
        start = self.commanded
        way = goal - start

        def path(t: float, derivative: int = 0) -> Row:
            s = t / seconds
            return way * (6.0 * s - 6.0 * s * s) / seconds if derivative else start + way * (3.0 * s * s - 2.0 * s**3)

        self.follow(path, seconds)
        self.command(goal)
        self.run(0.2)

    @property
    def commanded(self) -> Row:
        return np.asarray(self.out.position_counts / self._counts_per_rad)

    @property
    def positions(self) -> Row:
        """(6,) encoder positions, rad."""
        return np.asarray(self.inp.position_counts / self._counts_per_rad)

    @property
    def truth(self) -> Row:
        """(6,) true joint positions, rad."""
        return self.arm.truth().positions[:N_JOINTS]

    @property
    def speeds(self) -> Row:
        """(6,) joint speeds, rad/s."""
        return self.arm.truth().speeds[:N_JOINTS]

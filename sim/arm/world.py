"""The arm in physics: one ``step`` is one engine cycle, after the engine's exchange with ``bus``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.arm.drives import ArmDrives
from sim.arm.faults import FAULT_KINDS
from sim.arm.model import FINGERS, write_arm
from sim.arm.params import N_JOINTS, ArmParams
from sim.plant.drive_loops import JointIndex
from sim.plant.fault_table import FaultKind
from sim.plant.world import SimulationDiverged

_CHECK_PERIOD_STEPS = 16


@dataclass(frozen=True, slots=True)
class ArmTruth:
    """The true state: joints in axis order, then the two fingers. rad and m, rad/s and m/s, Nm and N; (8,) each."""

    positions: NDArray[np.float64]
    speeds: NDArray[np.float64]
    efforts: NDArray[np.float64]


class ArmWorld:
    """A Plant. Nothing in it is random: the same commands give the same bits."""

    fault_kinds: Mapping[str, FaultKind] = {kind.name: kind for kind in FAULT_KINDS}

    def __init__(self, params: ArmParams, dt_s: float) -> None:
        self.params, self.dt_s = params, dt_s
        self.model = mujoco.MjModel.from_xml_string(write_arm(params, dt_s))
        self.data = mujoco.MjData(self.model)
        self.bus = ArmDrives(params, dt_s)
        self.steps = 0
        self._index = JointIndex.of(self.model, params.names)
        fingers = JointIndex.of(self.model, FINGERS)
        self._all = JointIndex(
            np.concatenate([self._index.qpos, fingers.qpos]), np.concatenate([self._index.qvel, fingers.qvel])
        )
        self._qpos, self._qvel = self.data.qpos, self.data.qvel
        self._load, self._friction = self.data.qfrc_bias, self.model.dof_frictionloss
        self._torque, self._fingers = self.data.ctrl[:N_JOINTS], self.data.ctrl[N_JOINTS:]
        self._stroke_m, self._finger_step_m = params.gripper.stroke_m, params.gripper.speed_mps * dt_s
        self._finger_m = 0.0
        self._payload = int(self.model.body("payload").id)
        self._qpos[self._index.qpos] = params.start_rad
        mujoco.mj_forward(self.model, self.data)
        self.bus.begin(self._qpos, self._index)

    @property
    def time_s(self) -> float:
        """Simulated time since the start."""
        return self.steps * self.dt_s

    def step(self) -> None:
        """One cycle of drives and physics. Raises SimulationDiverged."""
        self.bus.step(self._qvel, self._load, self._index, self._torque, self._friction)
        self._move_fingers()
        mujoco.mj_step(self.model, self.data)
        self.bus.observe(self._qpos, self._index)
        self.steps += 1
        if self.steps % _CHECK_PERIOD_STEPS == 0 and not math.isfinite(float(self._qvel.sum())):
            raise SimulationDiverged(f"the arm's physics diverged at {self.time_s:.3f} s")

    def _move_fingers(self) -> None:
        goal_m = self._stroke_m if self.bus.gripper_closes else 0.0
        if goal_m != self._finger_m:
            remaining_m, step_m = goal_m - self._finger_m, self._finger_step_m
            self._finger_m = (
                goal_m if abs(remaining_m) <= step_m else self._finger_m + math.copysign(step_m, remaining_m)
            )
            self._fingers[:] = self._finger_m

    def set_payload(self, mass_kg: float) -> None:
        """A point mass between the fingertips, from now on."""
        self.model.body_mass[self._payload] = max(mass_kg, 1e-6)
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))

    def truth(self) -> ArmTruth:
        """The true state, without encoder errors or bus delay."""
        forces = self.data.actuator_force
        return ArmTruth(self._qpos[self._all.qpos], self._qvel[self._all.qvel], np.array(forces))

    def cube_position_m(self) -> NDArray[np.float64]:
        """(3,) middle of the cube from the foot of the pedestal. Raises KeyError without a cube."""
        return np.array(self.data.body("cube").xpos)

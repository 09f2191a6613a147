"""The wheelchair in the physics: its passenger, its place, its parking brake, and its coupling to the robot."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Pose2, quaternion_from_yaw
from robot_stack.core.robot import Robot
from sim.params import SimParams
from sim.plant.chair_model import CASTORS, SIDES
from sim.plant.inertia import wheelchair_inertial
from sim.plant.mjcf import CHAIR_BITS, NO_BITS

# A chair without a place yet floats out of reach of sensors and wheels.
_PARKED_AT_M = (0.0, 0.0, -5.0)
_MOVE_S = 0.2
Matrix = NDArray[np.float64]


class Chair:
    """Robot and wheelchair of one model; ``step`` every physics step, before the physics."""

    def __init__(self, robot: Robot, params: SimParams, model: Any, data: Any, passenger_mass_kg: float) -> None:
        self._robot, self._params = robot, params
        self._model, self._data = model, data
        joint = model.joint("wheelchair")
        self._start, self._dof = int(joint.qposadr[0]), int(joint.dofadr[0])
        self._body = model.body("wheelchair").id
        self._castors = [model.geom(name).id for name in CASTORS]
        self._hooks = [model.site(f"latch_{side}").id for side in SIDES]
        self._rails = [model.site(f"chair_latch_{side}").id for side in SIDES]
        self._equalities = [model.equality(f"latch_{side}").id for side in SIDES]
        self._hooks_at_rest = model.site_pos[self._hooks].copy()
        self._caught_at = self._hooks_at_rest
        self._push: tuple[int, Matrix] = (0, np.zeros(3))
        self.in_sight = False
        self.set_passenger_mass(passenger_mass_kg)
        self.park()

    # --- where it is ----------------------------------------------------------------------------------------------

    def pose(self) -> Matrix:
        """(7,) in map: x y z m, w x y z."""
        return np.array(self._data.qpos[self._start : self._start + 7])

    def matrix(self) -> Matrix:
        """(4, 4) pose in map."""
        return matrix_of(self.pose())

    def place(self, pose: Pose2) -> None:
        """Puts it on the ground there, at rest, with its brake closed."""
        x, y, z, w = quaternion_from_yaw(pose.yaw)
        self._put((pose.x, pose.y, 0.0), (w, x, y, z))
        self.release()

    def park(self) -> None:
        """Makes it invisible, weightless and without contacts."""
        self._put(_PARKED_AT_M, (1.0, 0.0, 0.0, 0.0))
        self._show(False)

    def move(self, along_m: float, across_m: float, turn_rad: float) -> None:
        """Shifts the standing chair by this in its own frame within 0.2 s, as a person would push it."""
        steps = max(1, round(_MOVE_S / self._params.physics.timestep_s))
        pose = self.matrix()
        shift = pose[:2, :2] @ (along_m, across_m)
        self._push = (steps, np.array([shift[0], shift[1], turn_rad]) / (steps * self._params.physics.timestep_s))

    def shift(self, x_m: float, y_m: float) -> None:
        """Displaces it in map at once; its motion goes on."""
        self._data.qpos[self._start : self._start + 2] += x_m, y_m

    def step(self) -> None:
        """Continues a running shift."""
        steps, velocity = self._push
        if steps == 0:
            return
        qpos, dt_s = self._data.qpos, self._params.physics.timestep_s
        self._push = (steps - 1, velocity)
        qpos[self._start : self._start + 2] += velocity[:2] * dt_s
        turn = np.array([math.cos(0.5 * velocity[2] * dt_s), 0.0, 0.0, math.sin(0.5 * velocity[2] * dt_s)])
        old = qpos[self._start + 3 : self._start + 7].copy()
        mujoco.mju_mulQuat(qpos[self._start + 3 : self._start + 7], turn, old)
        self._data.qvel[self._dof : self._dof + 6] = 0.0

    def _put(self, position_m: tuple[float, ...], quaternion_wxyz: tuple[float, ...]) -> None:
        self._data.qpos[self._start : self._start + 7] = *position_m, *quaternion_wxyz
        self._data.qvel[self._dof : self._dof + 6] = 0.0
        self._show(True)

    def _show(self, in_sight: bool) -> None:
        """Enables or disables weight and contact."""
        self.in_sight = in_sight
        model, mine = self._model, self._model.geom_bodyid == self._body
        model.body_gravcomp[self._body] = 0.0 if in_sight else 1.0
        contact_type, affinity = CHAIR_BITS if in_sight else NO_BITS
        model.geom_contype[mine] = model.body_contype[self._body] = contact_type
        model.geom_conaffinity[mine] = model.body_conaffinity[self._body] = affinity

    # --- load and brake -------------------------------------------------------------------------------------------

    def set_passenger_mass(self, passenger_mass_kg: float) -> None:
        """Changes the passenger's mass. Raises ValueError."""
        inertial = wheelchair_inertial(self._robot, self._params.wheelchair, passenger_mass_kg)
        self._model.body_mass[self._body] = inertial.mass_kg
        self._model.body_inertia[self._body] = inertial.diagonal_kgm2
        self._model.body_ipos[self._body] = inertial.centre_m
        self._model.body_iquat[self._body] = 1.0, 0.0, 0.0, 0.0
        # Recomputes what the solver derives from masses; it works on a scratch state, never on the running one.
        mujoco.mj_setConst(self._model, mujoco.MjData(self._model))

    def set_brake(self, closed: bool) -> None:
        chair = self._params.wheelchair
        self._model.geom_friction[self._castors, 0] = chair.brake_friction if closed else chair.rolling_resistance

    # --- held by the latch ----------------------------------------------------------------------------------------

    @property
    def held(self) -> bool:
        return bool(self._data.eq_active[self._equalities[0]])

    def misalignment(self) -> Matrix:
        """(4,) along, across, height m and yaw rad of base_link off its docked pose, in the chair frame."""
        inward = np.linalg.inv(self.matrix()) @ matrix_of(self._data.qpos[:7])
        yaw = math.atan2(inward[1, 0], inward[0, 0])
        return np.array([inward[0, 3] + self.docked_ahead_m, inward[1, 3], inward[2, 3], yaw])

    @property
    def docked_ahead_m(self) -> float:
        """From base_link ahead to the chair's frame, docked."""
        return self._robot.latch.x_m + self._params.wheelchair.rail_length_m

    def catch(self) -> None:
        """The hooks grip the rail ends in place and the parking brake opens; ``draw`` then pulls."""
        inward = np.linalg.inv(matrix_of(self._data.qpos[:7])) @ self.matrix()
        rails = self._model.site_pos[self._rails]
        self._caught_at = rails @ inward[:3, :3].T + inward[:3, 3]
        self.draw(0.0)
        self._push = (0, np.zeros(3))
        self._data.eq_active[self._equalities] = True
        self.set_brake(False)

    def draw(self, share: float) -> None:
        """0: the hooks hold the rails where they caught them, 1: in the dock pose; smooth in between."""
        smooth = 0.5 - 0.5 * math.cos(math.pi * share)
        self._model.site_pos[self._hooks] = self._caught_at + smooth * (self._hooks_at_rest - self._caught_at)

    def release(self) -> None:
        """The hooks release and the parking brake closes."""
        self._data.eq_active[self._equalities] = False
        self._model.site_pos[self._hooks] = self._hooks_at_rest
        self.set_brake(True)

    def attach(self) -> None:
        """At once in the dock pose before the robot, moving with it, held."""
        base = matrix_of(self._data.qpos[:7])
        x, y, z = (float(v) for v in base[:3, 3] + self.docked_ahead_m * base[:3, 0])
        self._put((x, y, z), tuple(self._data.qpos[3:7]))
        turning = base[:3, :3] @ self._data.qvel[3:6]
        self._data.qvel[self._dof : self._dof + 3] = self._data.qvel[0:3] + np.cross(
            turning, self.docked_ahead_m * base[:3, 0]
        )
        self._data.qvel[self._dof + 3 : self._dof + 6] = self._data.qvel[3:6]
        self._caught_at = self._hooks_at_rest
        self.draw(1.0)
        self._data.eq_active[self._equalities] = True
        self.set_brake(False)


def matrix_of(pose: Matrix) -> Matrix:
    """(4, 4) of a free joint's (7,): position, quaternion w x y z."""
    turned = np.zeros(9)
    mujoco.mju_quat2Mat(turned, pose[3:7])
    matrix = np.eye(4)
    matrix[:3, :3] = turned.reshape(3, 3)
    matrix[:3, 3] = pose[:3]
    return matrix

"""The physical world: MuJoCo, the servo drives in it, and what is true about the robot.

One ``step`` is one engine cycle: whoever drives the world calls the engine first, which talks to ``drives`` through
``exchange``, then ``step``. Everything random comes from one seed, so that the same seed gives the same bits.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robot_stack.contract.frames import DRIVE_AXES, MODULES
from robot_stack.core.geometry import Pose2, quaternion_from_yaw, yaw_from_quaternion
from robot_stack.core.robot import Robot
from sim.drives import JointIndex, ServoDrives
from sim.inertia import Inertial, wheelchair_inertial
from sim.mjcf import CHAIR_BITS, ROBOT_BITS
from sim.model import write_mjcf
from sim.parameters import SimParams
from sim.robot_model import Tolerances, torsional_friction_m
from sim.surface import Surface
from sim.worldfile import WorldFile

# The ground under the wheels is looked up this often: 3 mm of travel at full speed are less than a contact patch.
_SURFACE_PERIOD_STEPS = 2
# A parked wheelchair floats out of the way of sensors and wheels.
_CHAIR_PARKED_AT_M = (0.0, 0.0, -5.0)


def _warn(message: str) -> None:
    warnings.warn(f"physics: {message}", RuntimeWarning, stacklevel=2)


# MuJoCo's own way is a file MUJOCO_LOG.TXT in whatever folder the process runs in.
mujoco.set_mju_user_warning(_warn)


class SimulationDiverged(Exception):
    """The physics has left the finite numbers; nothing after this moment means anything."""


@dataclass(frozen=True, slots=True)
class Setup:
    """What makes one run: the world file, the seed, where the robot starts, and the wheelchair with it.

    wheelchair: a wheelchair is in the model and can be attached.
    passenger_mass_kg: a passenger in it; attached_at_start latches it to the robot from the first moment.
    """

    world: WorldFile
    seed: int
    start: Pose2
    wheelchair: bool = False
    attached_at_start: bool = False
    passenger_mass_kg: float = 0.0


@dataclass(frozen=True, slots=True)
class Truth:
    """The robot as it is. Pose of base_link in map (quaternion x y z w); twist in base_link, m/s and rad/s.

    joint_positions_rad, joint_speeds_radps, joint_torques_nm: (8,) in axis order, true angles without encoder errors.
    """

    time_s: float
    position_m: tuple[float, float, float]
    quaternion_xyzw: tuple[float, float, float, float]
    linear_mps: tuple[float, float, float]
    angular_radps: tuple[float, float, float]
    joint_positions_rad: NDArray[np.float64]
    joint_speeds_radps: NDArray[np.float64]
    joint_torques_nm: NDArray[np.float64]

    def pose(self) -> Pose2:
        return Pose2(self.position_m[0], self.position_m[1], yaw_from_quaternion(*self.quaternion_xyzw))


class World:
    """Robot, drives and ground.

    Raises ValueError or ConfigError for a set-up that cannot be built.
    """

    def __init__(self, robot: Robot, params: SimParams, setup: Setup) -> None:
        self.robot, self.params, self.setup = robot, params, setup
        seeds = np.random.SeedSequence(setup.seed).spawn(3)
        machine, drive_noise, self._sensor_seed = seeds
        self.tolerances = draw_tolerances(robot, params, np.random.default_rng(machine))
        wheelchair = setup.wheelchair or setup.attached_at_start
        self.mjcf = write_mjcf(robot, params, setup.world, self.tolerances, wheelchair)
        self.model = mujoco.MjModel.from_xml_string(self.mjcf)
        self.data = mujoco.MjData(self.model)
        self.has_wheelchair = wheelchair
        self.dt_s = params.physics.timestep_s
        self.drives = ServoDrives(robot, params, self.tolerances, self.dt_s, np.random.default_rng(drive_noise))
        self.surface = Surface(setup.world)
        self._index = JointIndex(self.model)
        self._wheel_geoms = [self.model.geom(f"{name}_wheel").id for name in MODULES]
        self._surface_was_uniform = True
        self._qpos, self._qvel, self._ctrl = self.data.qpos, self.data.qvel, self.data.ctrl
        self._friction = self.model.dof_frictionloss
        self.steps = 0
        self._place(setup)

    @property
    def time_s(self) -> float:
        """Simulated time since the start."""
        return self.steps * self.dt_s

    def sensor_random(self) -> np.random.Generator:
        """The generator of the sensors' noise: of its own, so that reading a sensor does not change the drives."""
        return np.random.default_rng(self._sensor_seed)

    # --- one step -------------------------------------------------------------------------------------------------

    def step(self) -> None:
        """One engine cycle of physics. Raises SimulationDiverged."""
        if self.steps % _SURFACE_PERIOD_STEPS == 0:
            self._update_surface()
        self.drives.step(self._qpos, self._qvel, self._index, self._ctrl, self._friction)
        mujoco.mj_step(self.model, self.data)
        self.steps += 1
        if not math.isfinite(self._qpos[0] + self._qvel[0]):
            raise SimulationDiverged(f"the physics diverged at {self.time_s:.3f} s")

    def _update_surface(self) -> None:
        if self.surface.is_uniform and self._surface_was_uniform:
            return
        self._surface_was_uniform = self.surface.is_uniform
        for wheel, geom in enumerate(self._wheel_geoms):
            x, y, _ = self.data.geom_xpos[geom]
            friction = self.surface.friction_at(float(x), float(y), wheel)
            self.model.geom_friction[geom, 0] = friction
            self.model.geom_friction[geom, 1] = torsional_friction_m(friction, self.params)

    # --- truth ----------------------------------------------------------------------------------------------------

    def truth(self) -> Truth:
        """The robot as it is now. Cheap enough for every step, meant for 50 Hz."""
        qpos, qvel = self._qpos, self._qvel
        w, x, y, z = (float(v) for v in qpos[3:7])
        return Truth(
            time_s=self.time_s,
            position_m=(float(qpos[0]), float(qpos[1]), float(qpos[2])),
            quaternion_xyzw=(x, y, z, w),
            linear_mps=_to_body((x, y, z, w), (float(qvel[0]), float(qvel[1]), float(qvel[2]))),
            # The rotation of a free joint is in the body's own frame.
            angular_radps=(float(qvel[3]), float(qvel[4]), float(qvel[5])),
            joint_positions_rad=qpos[self._index.qpos],
            joint_speeds_radps=qvel[self._index.qvel],
            joint_torques_nm=self._ctrl.copy(),
        )

    def wheel_slip_mps(self) -> NDArray[np.float64]:
        """(4, 2) slip of each wheel against the ground: along and across the wheel, m/s, for wheels on flat ground."""
        slip = np.zeros((4, 2))
        velocity = np.zeros(6)
        for i, name in enumerate(MODULES):
            body = self.model.body(f"{name}_steer").id
            mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 1)
            rolling = self._qvel[self._index.qvel[DRIVE_AXES[i]]] * self.tolerances.wheel_radii_m[i]
            slip[i] = velocity[3] - rolling, velocity[4]
        return slip

    def normal_forces_n(self) -> NDArray[np.float64]:
        """(4,) load on each wheel."""
        loads = np.zeros(4)
        force = np.zeros(6)
        for k in range(self.data.ncon):
            contact = self.data.contact[k]
            for wheel, geom in enumerate(self._wheel_geoms):
                if geom in (contact.geom1, contact.geom2):
                    mujoco.mj_contactForce(self.model, self.data, k, force)
                    loads[wheel] += force[0]
        return loads

    # --- wheelchair -----------------------------------------------------------------------------------------------

    @property
    def attached(self) -> bool:
        """A wheelchair hangs on the latch."""
        return self.has_wheelchair and bool(self.data.eq_active[self.model.equality("latch_left").id])

    def attach_wheelchair(self, passenger_mass_kg: float) -> None:
        """Puts the wheelchair in front of the robot, moving with it, and closes the latch.

        Raises ValueError if there is no wheelchair in this world or the passenger is too heavy.
        """
        if not self.has_wheelchair:
            raise ValueError("this world has no wheelchair")
        chair = self.params.wheelchair
        self._load_wheelchair(wheelchair_inertial(self.robot, chair, passenger_mass_kg))
        self.model.body_gravcomp[self.model.body("wheelchair").id] = 0.0
        truth = self.truth()
        joint = self.model.joint("wheelchair")
        ahead = Pose2(chair.latch_x_m + 0.5 * chair.length_m, 0.0, 0.0)
        pose = truth.pose().compose(ahead)
        start, dof = joint.qposadr[0], joint.dofadr[0]
        x, y, z, w = quaternion_from_yaw(pose.yaw)
        self._qpos[start : start + 7] = pose.x, pose.y, truth.position_m[2], w, x, y, z
        self._qvel[dof : dof + 6] = self._qvel[0:6]
        # The chair's middle is ahead of the robot's: turning moves it sideways.
        sideways = truth.angular_radps[2] * ahead.x
        self._qvel[dof : dof + 2] += -math.sin(pose.yaw) * sideways, math.cos(pose.yaw) * sideways
        self._latch(True)

    def detach_wheelchair(self) -> None:
        """Opens the latch; the chair stays where it is."""
        if self.has_wheelchair:
            self._latch(False)

    def set_passenger_mass(self, passenger_mass_kg: float) -> None:
        """Changes who sits in the chair. Raises ValueError."""
        if not self.has_wheelchair:
            raise ValueError("this world has no wheelchair")
        self._load_wheelchair(wheelchair_inertial(self.robot, self.params.wheelchair, passenger_mass_kg))

    def _latch(self, closed: bool) -> None:
        for side in ("left", "right"):
            self.data.eq_active[self.model.equality(f"latch_{side}").id] = closed
        # Latched, chair and chassis touch for good: the latch alone carries the force between them.
        self._set_chair_contact(*((0, CHAIR_BITS[1] & ~ROBOT_BITS[0]) if closed else CHAIR_BITS))

    def _set_chair_contact(self, contact_type: int, affinity: int) -> None:
        body = self.model.body("wheelchair").id
        mine = self.model.geom_bodyid == body
        self.model.geom_contype[mine] = self.model.body_contype[body] = contact_type
        self.model.geom_conaffinity[mine] = self.model.body_conaffinity[body] = affinity

    def _load_wheelchair(self, inertial: Inertial) -> None:
        body = self.model.body("wheelchair").id
        self.model.body_mass[body] = inertial.mass_kg
        self.model.body_inertia[body] = inertial.diagonal_kgm2
        self.model.body_ipos[body] = inertial.centre_m
        self.model.body_iquat[body] = 1.0, 0.0, 0.0, 0.0
        # Recomputes what the solver derives from masses; it works on a scratch state, never on the running one.
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))

    # --- start ----------------------------------------------------------------------------------------------------

    def _place(self, setup: Setup) -> None:
        x, y, z, w = quaternion_from_yaw(setup.start.yaw)
        self._qpos[0:7] = setup.start.x, setup.start.y, 0.0, w, x, y, z
        if self.has_wheelchair:
            self._park_wheelchair()
            self.set_passenger_mass(setup.passenger_mass_kg)
        if setup.attached_at_start:
            self.attach_wheelchair(setup.passenger_mass_kg)
        mujoco.mj_forward(self.model, self.data)

    def _park_wheelchair(self) -> None:
        start = self.model.joint("wheelchair").qposadr[0]
        self._qpos[start : start + 3] = _CHAIR_PARKED_AT_M
        self._set_chair_contact(0, 0)


def draw_tolerances(robot: Robot, params: SimParams, random: np.random.Generator) -> Tolerances:
    """One machine out of the series: true wheel radii and steering zeros."""
    radii = robot.wheel_radius_m * (1.0 + params.wheel.radius_tolerance * random.standard_normal(4))
    zeros = params.steering.zero_error_rad * random.standard_normal(4)
    return Tolerances(_four(radii), _four(zeros))


def _four(values: NDArray[np.float64]) -> tuple[float, float, float, float]:
    a, b, c, d = (float(value) for value in values)
    return a, b, c, d


def _to_body(
    quaternion_xyzw: tuple[float, float, float, float], vector: tuple[float, float, float]
) -> tuple[float, float, float]:
    """A vector of the map frame, in the frame turned by the quaternion."""
    x, y, z, w = quaternion_xyzw
    inverse = np.array([w, -x, -y, -z])
    turned = np.zeros(3)
    mujoco.mju_rotVecQuat(turned, np.array(vector), inverse)
    return float(turned[0]), float(turned[1]), float(turned[2])

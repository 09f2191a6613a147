"""The physical world: MuJoCo, the servo drives in it, and the robot's ground truth.

One ``step`` is one engine cycle: the caller first runs the engine, which communicates with ``drives`` through
``exchange``, then ``step``. All random numbers come from one seed, so that equal seeds give equal bits.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robot_stack.contract import frames
from robot_stack.contract.frames import DRIVE_AXES, MODULES
from robot_stack.core.geometry import Pose2, quaternion_from_yaw, wrap_angle, yaw_from_quaternion
from robot_stack.core.robot import Robot
from sim.params import SimParams
from sim.plant.contacts import CHAIR, ROBOT, Contacts, parts
from sim.plant.doors import Building
from sim.plant.drive_loops import JointIndex
from sim.plant.drives import ServoDrives
from sim.plant.edge import Edge
from sim.plant.latch import Latch
from sim.plant.model import write_mjcf
from sim.plant.people import walkers
from sim.plant.robot_model import Tolerances, torsional_friction_m
from sim.plant.setup import Setup as Setup
from sim.plant.surface import Surface
from sim.plant.wheelchair import Chair, matrix_of

# The ground under the wheels is looked up this often: 3 mm of travel at full speed are less than a contact patch.
_SURFACE_PERIOD_STEPS = 2
# People move by at most 15 mm at a time.
_PEOPLE_PERIOD_STEPS = 10
WHEELCHAIR = "wheelchair"  # frame id


def _warn(message: str) -> None:
    warnings.warn(f"physics: {message}", RuntimeWarning, stacklevel=2)


# By default MuJoCo writes a file MUJOCO_LOG.TXT in the current folder.
mujoco.set_mju_user_warning(_warn)


class SimulationDiverged(Exception):
    """The physics is no longer finite; all later results are invalid."""


@dataclass(frozen=True, slots=True)
class Truth:
    """The robot's true state. Pose of base_link in map (quaternion x y z w); twist in base_link, m/s and rad/s.

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
        wheelchair = setup.has_wheelchair()
        self.people = walkers(setup.world.people if setup.people else ())
        self.building = Building(setup.world.doors, setup.world.lifts)
        names = [walker.name for walker in self.people]
        self.mjcf = write_mjcf(robot, params, setup.world, self.tolerances, wheelchair, names)
        self.model = mujoco.MjModel.from_xml_string(self.mjcf)
        self.data = mujoco.MjData(self.model)
        self.model.opt.gravity[:] = setup.gravity_mps2()
        self.dt_s = params.physics.timestep_s
        self.drives = ServoDrives(robot, params, self.tolerances, self.dt_s, np.random.default_rng(drive_noise))
        self.surface = Surface(setup.world)
        self._index = JointIndex.of(self.model)
        self._wheel_geoms = [self.model.geom(f"{name}_wheel").id for name in MODULES]
        # In any attitude.
        self._wheels_within_m = robot.wheel_radius_m + max(math.hypot(*place) for place in robot.module_positions_m())
        self._surface_was_uniform = True
        self._qpos, self._qvel, self._ctrl = self.data.qpos, self.data.qvel, self.data.ctrl
        self._friction = self.model.dof_frictionloss
        self._mocap_pos, self._mocap_quat = self.data.mocap_pos, self.data.mocap_quat
        self.steps = 0
        self._part = parts(self.model)
        self._contacts = Contacts(self.model, setup.world, [self.model.body(f"{name}_wheel").id for name in MODULES])
        self._mocap = [int(self.model.body(name).mocapid[0]) for name in names]
        self._door_mocap = [int(self.model.body(door.name).mocapid[0]) for door in self.building.doors]
        self._stations = [(name, on_ground(place.pose())) for name, place in setup.world.stations.items()]
        self.chair = Chair(robot, params, self.model, self.data, setup.passenger_mass_kg) if wheelchair else None
        edge = robot.safety_edge
        self.edge = None if edge is None else Edge(edge, self.model, self.data, self.drives, self._part, params)
        self.latch = Latch(params.latch, self.drives, self.chair, self.dt_s)
        self._place(setup)

    @property
    def time_s(self) -> float:
        """Simulated time since the start."""
        return self.steps * self.dt_s

    def sensor_random(self) -> np.random.Generator:
        """The generator of the sensors' noise: a separate one, so that reading a sensor does not change the drives."""
        return np.random.default_rng(self._sensor_seed)

    # --- one step -------------------------------------------------------------------------------------------------

    def step(self) -> None:
        """One engine cycle of physics. Raises SimulationDiverged."""
        if self.steps % _SURFACE_PERIOD_STEPS == 0:
            self._update_surface()
        if self.steps % _PEOPLE_PERIOD_STEPS == 0:
            self._walk(_PEOPLE_PERIOD_STEPS * self.dt_s)
            self._contacts.note(self.data, self.time_s)
        self.drives.step(self._qpos, self._qvel, self._index, self._ctrl, self._friction)
        self.latch.step()
        if self.edge is not None:
            self.edge.step()
        if self.chair is not None:
            self.chair.step()
        mujoco.mj_step(self.model, self.data)
        self.steps += 1
        if not math.isfinite(self._qpos[0] + self._qvel[0]):
            raise SimulationDiverged(f"the physics diverged at {self.time_s:.3f} s")

    def _walk(self, dt_s: float) -> None:
        machine = Pose2(float(self._qpos[0]), float(self._qpos[1]), self._yaw())
        footprint = self.robot.footprint_with_chair if self.attached else self.robot.footprint
        for walker, mocap in zip(self.people, self._mocap, strict=True):
            walker.step(dt_s, machine, footprint)
            self._put(walker.pose(), mocap)
        for transfer in self.building.step(self.time_s, dt_s):
            if transfer.moves(machine.x, machine.y):
                self._shift(transfer.end.x_m - transfer.start.x_m, transfer.end.y_m - transfer.start.y_m)
        self._put_doors()

    def _shift(self, x_m: float, y_m: float) -> None:
        """Moves the robot, and the wheelchair that it holds, with the cabin of a lift; its motion goes on."""
        self._qpos[0:2] += x_m, y_m
        if self.chair is not None and self.chair.held:
            self.chair.shift(x_m, y_m)

    def _put_doors(self) -> None:
        for door, mocap in zip(self.building.doors, self._door_mocap, strict=True):
            self._put(door.pose(), mocap)

    def _put(self, pose: Pose2, mocap: int) -> None:
        x, y, z, w = quaternion_from_yaw(pose.yaw)
        self._mocap_pos[mocap] = pose.x, pose.y, 0.0
        self._mocap_quat[mocap] = w, x, y, z

    def _yaw(self) -> float:
        w, x, y, z = self._qpos[3:7].tolist()
        return yaw_from_quaternion(x, y, z, w)

    def _update_surface(self) -> None:
        qpos = self._qpos
        is_uniform = self.surface.is_uniform(qpos.item(0), qpos.item(1), self._wheels_within_m)
        if is_uniform and self._surface_was_uniform:
            return
        self._surface_was_uniform = is_uniform
        for wheel, geom in enumerate(self._wheel_geoms):
            x, y, _ = self.data.geom_xpos[geom]
            friction = self.surface.friction_at(float(x), float(y), wheel)
            self.model.geom_friction[geom, 0] = friction
            self.model.geom_friction[geom, 1] = torsional_friction_m(friction, self.params)

    # --- truth ----------------------------------------------------------------------------------------------------

    def truth(self) -> Truth:
        """The robot's true state now. Cheap enough for every step, meant for 50 Hz."""
        qpos, qvel = self._qpos, self._qvel
        px, py, pz, w, x, y, z = qpos[:7].tolist()
        vx, vy, vz, wx, wy, wz = qvel[:6].tolist()
        return Truth(
            time_s=self.time_s,
            position_m=(px, py, pz),
            quaternion_xyzw=(x, y, z, w),
            linear_mps=_to_body((x, y, z, w), (vx, vy, vz)),
            # The rotation of a free joint is in the body's own frame.
            angular_radps=(wx, wy, wz),
            joint_positions_rad=qpos[self._index.qpos],
            joint_speeds_radps=self.joint_speeds_radps(),
            joint_torques_nm=self._ctrl.copy(),
        )

    def joint_speeds_radps(self) -> NDArray[np.float64]:
        """(8,) true speeds in axis order."""
        speeds: NDArray[np.float64] = self._qvel[self._index.qvel]
        return speeds

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

    def contact_force_n(self) -> float:
        """Contact force between robot and wheelchair, N, without the latch's own force.

        The sum of the magnitudes over all contacts, so that a chair that is squeezed shows it.
        """
        if self.chair is None:
            return 0.0
        total, force = 0.0 if self.edge is None else self.edge.chair_force_n, np.zeros(6)
        for k in range(self.data.ncon):
            contact = self.data.contact[k]
            first, second = (self._part[self.model.geom_bodyid[geom]] for geom in (contact.geom1, contact.geom2))
            if {first, second} == {ROBOT, CHAIR}:
                mujoco.mj_contactForce(self.model, self.data, k, force)
                total += math.sqrt(float(force[:3] @ force[:3]))
        return total

    def touching(self) -> tuple[str, ...]:
        """Present contacts of robot and wheelchair, except ground, ramps and each other: names of solids and people,
        and of pits with a wheel over them.
        """
        return self._contacts.now(self.data)

    @property
    def touched(self) -> dict[str, float]:
        """All results of ``touching`` since the start, sampled every 10 ms, with their first times, s."""
        return self._contacts.first_s

    # --- wheelchair -----------------------------------------------------------------------------------------------

    @property
    def attached(self) -> bool:
        """True if a wheelchair is latched."""
        return self.chair is not None and self.chair.held

    def wheelchair_pose(self) -> NDArray[np.float64] | None:
        """(4, 4) frame of the wheelchair (that of its dock) in map; None without one, or before it is placed."""
        return self.chair.matrix() if self.chair is not None and self.chair.in_sight else None

    def dock_error(self, dock_pose: Pose2) -> tuple[float, float, float]:
        """Along m, across m, yaw rad of base_link from ``dock_pose``, which is in the true frame of the wheelchair.

        Raises ValueError if no wheelchair stands in this world.
        """
        chair = self.wheelchair_pose()
        if chair is None:
            raise ValueError("no wheelchair stands in this world")
        base = np.linalg.inv(chair) @ matrix_of(self._qpos[:7])
        yaw = math.atan2(base[1, 0], base[0, 0])
        return float(base[0, 3]) - dock_pose.x, float(base[1, 3]) - dock_pose.y, wrap_angle(yaw - dock_pose.yaw)

    def attach_wheelchair(self, passenger_mass_kg: float) -> None:
        """Puts the wheelchair in front of the robot, moving with it, and closes the latch at once.

        Raises ValueError if there is no wheelchair in this world or the passenger is too heavy.
        """
        self._chair_or_error().set_passenger_mass(passenger_mass_kg)
        self.latch.force(closed=True)

    def detach_wheelchair(self) -> None:
        """Opens the latch at once; the chair stays where it is, with its brake closed."""
        self.latch.force(closed=False)

    def set_passenger_mass(self, passenger_mass_kg: float) -> None:
        """Changes the passenger's mass. Raises ValueError."""
        self._chair_or_error().set_passenger_mass(passenger_mass_kg)

    def move_wheelchair(self, along_m: float, across_m: float, turn_rad: float) -> None:
        """Shifts the standing chair by this in its own frame within 0.2 s. Raises ValueError if impossible."""
        chair = self._chair_or_error()
        if not chair.in_sight or chair.held:
            raise ValueError("the wheelchair hangs on the latch" if chair.held else "no wheelchair stands here")
        chair.move(along_m, across_m, turn_rad)

    def move_robot(self, along_m: float, across_m: float, turn_rad: float) -> None:
        """Moves the robot by this in its own frame, to rest. Raises ValueError with an attached chair."""
        if self.attached:
            raise ValueError("a wheelchair hangs on the latch")
        truth = self.truth()
        there = truth.pose().compose(Pose2(along_m, across_m, turn_rad))
        turned = np.zeros(4)
        x, y, z, w = quaternion_from_yaw(turn_rad)
        mujoco.mju_mulQuat(turned, np.array([w, x, y, z]), self._qpos[3:7].copy())
        self._qpos[0:2] = there.x, there.y
        self._qpos[3:7] = turned
        self._qvel[0:6] = 0.0

    def _chair_or_error(self) -> Chair:
        if self.chair is None:
            raise ValueError("this world has no wheelchair")
        return self.chair

    def bodies(self) -> list[tuple[str, NDArray[np.float64]]]:
        """Frame id and true pose in map of all bodies that move or carry markers: (7,) x y z m, w x y z."""
        found = [(frames.BASE_LINK, self._qpos[:7].copy())]
        if self.chair is not None and self.chair.in_sight:
            found.append((WHEELCHAIR, self.chair.pose()))
        people = [(walker.name, on_ground(walker.pose())) for walker in self.people]
        doors = [(door.name, on_ground(door.pose())) for door in self.building.doors]
        return found + self._stations + people + doors

    # --- start ----------------------------------------------------------------------------------------------------

    def _place(self, setup: Setup) -> None:
        x, y, z, w = quaternion_from_yaw(setup.start.yaw)
        self._qpos[0:7] = setup.start.x, setup.start.y, 0.0, w, x, y, z
        place = setup.wheelchair_place()
        if self.chair is not None and place is not None:
            self.chair.place(place)
        if setup.attached_at_start:
            self.latch.force(closed=True)
        for walker, mocap in zip(self.people, self._mocap, strict=True):
            self._put(walker.pose(), mocap)
        self._put_doors()
        mujoco.mj_forward(self.model, self.data)


def draw_tolerances(robot: Robot, params: SimParams, random: np.random.Generator) -> Tolerances:
    """One machine out of the series: true wheel radii and steering zeros."""
    radii = robot.wheel_radius_m * (1.0 + params.wheel.radius_tolerance * random.standard_normal(4))
    zeros = params.steering.zero_error_rad * random.standard_normal(4)
    return Tolerances(_four(radii), _four(zeros))


def on_ground(pose: Pose2) -> NDArray[np.float64]:
    """(7,) x y z m, w x y z of a pose on the ground."""
    x, y, z, w = quaternion_from_yaw(pose.yaw)
    return np.array([pose.x, pose.y, 0.0, w, x, y, z])


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

"""The stack's kernels and the physics in one process, in lockstep, without ROS and faster than real time.

Every kernel runs at the rate of its node, at a phase drawn from the seed, because nodes start at arbitrary times. A
message between two nodes arrives one transport delay later. Without a safety monitor the drive is always permitted.
"""

from __future__ import annotations

import heapq
import itertools
from abc import abstractmethod
from collections.abc import Callable

import numpy as np

from robot_stack.contract import topics
from robot_stack.contract.frames import JOINTS
from robot_stack.core.config import load
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.limits import MotionLimits
from robot_stack.core.robot import Robot, load_robot
from robot_stack.drive.arbitration import Arbiter, Source
from robot_stack.drive.controller import SwerveController
from robot_stack.drive.hardware_params import SwerveHardwareParams, axis_settings, session_settings
from robot_stack.drive.joint_states import encoders as encoders_of
from robot_stack.drive.kinematics import ModuleSetPoints
from robot_stack.drive.odometry import Encoders, Odometry
from robot_stack.drive.params import SwerveControllerParams
from robot_stack.drive.session import DriveSession
from robot_stack.localization.gyro import ImuSample as GyroSample
from robot_stack.localization.localizer import Localizer
from robot_stack.localization.odometry import OdometryReading, Variances
from robot_stack.localization.params import LocalizationParams
from robot_stack.wmx.config import load_engine_config
from sim.params import load_sim_params
from sim.plant.imu import ImuSample
from sim.plant.local_engine import LocalEngine
from sim.plant.simulation import Simulation
from sim.plant.world import Setup

_STEP_S = 0.001  # of the engine and the physics
_READY_LIMIT_S = 5.0
_ROUNDING_S = 1e-9
Task = Callable[[], None]


class KernelStack:
    """Drive, odometry and localization on simulated engine and physics, without the nodes around them.

    transport_s: delay of every message between two nodes. Raises RuntimeError if the engine does not become ready.
    """

    def __init__(self, setup: Setup, transport_s: float = 0.002) -> None:
        robot = load_robot()
        self.sim = Simulation(robot, load_sim_params(), setup)
        self._random = np.random.default_rng(setup.seed)
        self._transport_steps = max(1, round(transport_s / _STEP_S))
        self._messages: list[tuple[int, int, Task]] = []
        self._order = itertools.count()
        self._tasks: list[tuple[int, int, Task]] = []
        self.robot = robot
        self.hardware = _Hardware(robot, self.sim)
        self.drive = _Drive(robot, setup.attached_at_start)
        self.localizer = _localizer(robot, setup.start)
        self.every(topics.JOINT_STATES.nominal_rate_hz, self._joint_states)
        self.every(topics.WHEEL_COMMANDS.nominal_rate_hz, self._drive_tick)
        self.every(topics.CURRENT_POSE.nominal_rate_hz, self._localization_tick)
        self.every(topics.CMD_VEL.nominal_rate_hz, self._navigation_tick)
        if not self.run(lambda: self.hardware.session.ready, _READY_LIMIT_S):
            raise RuntimeError(f"the engine is not ready: {self.hardware.session.state.text}")

    @property
    def time_s(self) -> float:
        return self.sim.time_s

    def truth(self) -> tuple[Pose2, Twist2]:
        """True pose in map and true twist in base_link."""
        truth = self.sim.world.truth()
        return truth.pose(), Twist2(truth.linear_mps[0], truth.linear_mps[1], truth.angular_radps[2])

    def run(self, until: Callable[[], bool], limit_s: float) -> bool:
        """Steps until the condition, evaluated after every step, holds. Returns False if ``limit_s`` elapses first."""
        end_s = self.time_s + limit_s
        while self.time_s < end_s - _ROUNDING_S:
            self._step()
            if until():
                return True
        return False

    def _step(self) -> None:
        sample = self.sim.step()
        if sample is not None:
            self._imu(sample)
        steps = self.sim.world.steps
        for period, phase, task in self._tasks:
            if steps % period == phase:
                task()
        while self._messages and self._messages[0][0] <= steps:
            heapq.heappop(self._messages)[2]()

    def every(self, rate_hz: float, task: Task) -> None:
        """Calls ``task`` at this rate, at a phase drawn from the seed."""
        period = round(1.0 / (rate_hz * _STEP_S))
        self._tasks.append((period, int(self._random.integers(period)), task))

    def _send(self, deliver: Task) -> None:
        self.after(self._transport_steps * _STEP_S, deliver)

    def after(self, delay_s: float, task: Task) -> None:
        """Calls ``task`` once, after the given simulated time."""
        heapq.heappush(self._messages, (self.sim.world.steps + round(delay_s / _STEP_S), next(self._order), task))

    # --- nodes -------------------------------------------------------------------------------------------------------

    def _imu(self, sample: ImuSample) -> None:
        rotation = sample.rotation_radps
        gyro = GyroSample(sample.time_s, rotation[2], (*rotation, *sample.acceleration_mps2))
        self._send(lambda: self.localizer.on_imu(gyro))

    def _joint_states(self) -> None:
        encoders = self.hardware.tick(self.time_s)
        if encoders is not None:
            self._send(lambda: self._odometry(encoders))

    def _odometry(self, encoders: Encoders) -> None:
        odometry, stamp_s = self.drive.on_encoders(encoders), encoders.stamp_s
        reading = OdometryReading(
            stamp_s,
            odometry.pose,
            odometry.twist,
            _diagonal(odometry.pose_covariance),
            _diagonal(odometry.twist_covariance),
        )

        def deliver() -> None:
            self.localizer.on_odometry(reading, self.time_s)
            self.on_odometry(stamp_s, odometry)

        self._send(deliver)

    def on_odometry(self, stamp_s: float, odometry: Odometry) -> None:
        """Hook for subclasses that use odometry."""

    def _drive_tick(self) -> None:
        modules = self.drive.tick(self.time_s)
        if modules is not None:
            self._send(lambda: self.hardware.command(modules))

    def _localization_tick(self) -> None:
        """Hook for the localization of subclasses."""

    @abstractmethod
    def _navigation_tick(self) -> None:
        """Hook of subclasses that command the drive."""


class _Hardware:
    """The hardware interface's kernels with an engine in this process."""

    def __init__(self, robot: Robot, sim: Simulation) -> None:
        params = load(SwerveHardwareParams, "swerve_hardware_interface")
        local = LocalEngine(load_engine_config(), sim)
        local.start()
        self.engine = engine = local.client
        axes = axis_settings(params, robot, topics.WHEEL_COMMANDS.nominal_rate_hz)
        self.session = DriveSession(lambda: engine, session_settings(params.session), axes)

    def tick(self, now_s: float) -> Encoders | None:
        """Updates from the engine and returns the encoders once they are valid."""
        snapshot = self.session.poll(now_s, stop=False, may_switch_on=True).snapshot
        return None if snapshot is None else encoders_of(now_s, JOINTS, snapshot.actual_pos[: len(JOINTS)].tolist())

    def command(self, modules: ModuleSetPoints) -> None:
        self.session.follow(modules)


class _Drive:
    """The swerve controller, always permitted to drive."""

    def __init__(self, robot: Robot, passenger: bool) -> None:
        params = load(SwerveControllerParams, "swerve_controller")
        self._controller = SwerveController(params, robot)
        self._arbiter = Arbiter()
        self._limits = MotionLimits.of(robot.motion(passenger))

    @property
    def odometry(self) -> Odometry:
        return self._controller.odometry

    def on_encoders(self, encoders: Encoders) -> Odometry:
        return self._controller.observe(encoders)

    def on_command(self, source: Source, twist: Twist2, now_s: float) -> None:
        self._arbiter.command(source, twist, now_s)

    def tick(self, now_s: float) -> ModuleSetPoints | None:
        """The command for the modules; None before the first encoder values."""
        if self._controller.measured_rad is None:
            return None
        _, requested = self._arbiter.requested(now_s)
        return self._controller.step(requested, self._limits, now_s).modules


def _localizer(robot: Robot, start: Pose2) -> Localizer:
    given = {"start_x_m": start.x, "start_y_m": start.y, "start_yaw_rad": start.yaw}
    params = load(LocalizationParams, "ndt_localization", given)
    return Localizer(params, robot.empty.max_speed_mps, robot.empty.max_yaw_rate_radps)


def _diagonal(matrix: tuple[float, ...]) -> Variances:
    return matrix[0], matrix[4], matrix[8]

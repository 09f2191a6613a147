"""The robot without ROS: physics, engine and the drive's kernels in one process, faster than real time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from robot_stack.contract import topics
from robot_stack.contract.frames import DRIVE_AXES, STEER_AXES
from robot_stack.core.config import load
from robot_stack.core.geometry import Twist2
from robot_stack.core.limits import MotionLimits
from robot_stack.core.robot import Robot
from robot_stack.drive import axis_commands
from robot_stack.drive.arbitration import Command
from robot_stack.drive.controller import SwerveController
from robot_stack.drive.hardware_params import SwerveHardwareParams, axis_settings
from robot_stack.drive.kinematics import Four, ModuleSetPoints
from robot_stack.drive.odometry import Encoders, Odometry
from robot_stack.drive.params import SwerveControllerParams
from robot_stack.drive.wheel_axes import drive_moves, steer_moves
from robot_stack.wmx.api import ErrorCode, EStopLevel
from robot_stack.wmx.config import load_engine_config
from sim.params import SimParams
from sim.plant.faults import Faults
from sim.plant.imu import ImuSample
from sim.plant.local_engine import LocalEngine
from sim.plant.simulation import Simulation
from sim.plant.world import Setup
from sim.run.run_log import Moment

_SERVOS_ON_S = 0.3


class Controller(Protocol):
    """A controller of the robot in a rig. Times are simulated s."""

    def observe(self, encoders: Encoders) -> None:
        """A reading of the encoders, at the rate of /joint_states."""

    def command(self, time_s: float) -> ModuleSetPoints | None:
        """Set points of the modules, at the rate of /swerve/wheel_commands; None for no command."""


class Rig:
    """A robot with enabled servos. ``run`` runs a controller on it. on_imu: called with every sample of the IMU."""

    def __init__(self, robot: Robot, params: SimParams, setup: Setup) -> None:
        self.robot = robot
        self.sim = Simulation(robot, params, setup)
        self.faults = Faults(self.sim)
        self.engine = LocalEngine(load_engine_config(), self.sim)
        self.command_rate_hz = topics.WHEEL_COMMANDS.nominal_rate_hz
        self._reading_rate_hz = topics.JOINT_STATES.nominal_rate_hz
        hardware = load(SwerveHardwareParams, "swerve_hardware_interface")
        self._axes = axis_settings(hardware, robot, self.command_rate_hz)
        self._radius_m = robot.wheel_radius_m
        self.on_imu: Callable[[ImuSample], None] = lambda _: None
        self.engine.start()
        for axis in (*self._axes.drive_axes, *self._axes.steer_axes):
            self.engine.core_motion.axisControl.SetServoOn(axis, 1)
        self._steps(_SERVOS_ON_S)

    def run(self, duration_s: float, controller: Controller, each: Callable[[ModuleSetPoints | None], None]) -> None:
        """Runs ``controller``. ``each`` is called at every reading, with the newest set points."""
        set_points: ModuleSetPoints | None = None
        ticks = 0
        for reading in range(round(duration_s * self._reading_rate_hz)):
            controller.observe(self.encoders())
            if ticks <= reading * self.command_rate_hz / self._reading_rate_hz:
                ticks += 1
                set_points = controller.command(self.sim.time_s)
                if set_points is not None:
                    self.command(set_points)
            each(set_points)
            self._steps(1.0 / self._reading_rate_hz)

    def command(self, modules: ModuleSetPoints) -> bool:
        """Sends set points to the engine, like the hardware interface. False if the engine refused."""
        status, core = self.engine.status(), self.engine.core_motion
        drives = drive_moves(modules.speeds_mps, status.velocity_cmd[list(self._axes.drive_axes)].tolist(), self._axes)
        steers = steer_moves(modules.angles_rad, status.pos_cmd[list(self._axes.steer_axes)].tolist(), self._axes)
        codes = (
            axis_commands.drive(core, drives, self._axes.command_lifetime_s),
            axis_commands.steer(core, steers),
        )
        return codes == (ErrorCode.PyNone, ErrorCode.PyNone)

    def emergency_stop(self, active: bool) -> None:
        """The engine's emergency stop, level 1, or its release."""
        core = self.engine.core_motion
        if active:
            core.ExecEStop(EStopLevel.Level1)
        else:
            core.ReleaseEStop()

    def encoders(self) -> Encoders:
        """The engine's joint positions."""
        positions = self.engine.status().actual_pos
        drive, steer = list(self._axes.drive_axes), list(self._axes.steer_axes)
        return Encoders(self.sim.time_s, _four(positions[drive].tolist()), _four(positions[steer].tolist()))

    def moment(self) -> Moment:
        """The ground truth now."""
        truth = self.sim.world.truth()
        vx, vy, _ = truth.linear_mps
        speeds = self._radius_m * truth.joint_speeds_radps[list(DRIVE_AXES)]
        return Moment(
            truth.time_s,
            truth.pose(),
            Twist2(vx, vy, truth.angular_radps[2]),
            _four(speeds.tolist()),
            _four(truth.joint_positions_rad[list(STEER_AXES)].tolist()),
        )

    def _steps(self, duration_s: float) -> None:
        for _ in range(round(duration_s / self.sim.world.dt_s)):
            sample = self.sim.step()
            if sample is not None:
                self.on_imu(sample)
            self.faults.update()


class TwistController:
    """The swerve controller's kernels: follows ``requested(time)`` and keeps the odometry."""

    def __init__(self, robot: Robot, requested: Callable[[float], Twist2], passenger: bool) -> None:
        params = load(SwerveControllerParams, "swerve_controller")
        self._robot, self._requested = robot, requested
        self._controller = SwerveController(params, robot)
        self._limits = MotionLimits.of(robot.motion(passenger))
        self.stopped = False

    def set_passenger(self, attached: bool) -> None:
        """Other limits with a passenger."""
        self._limits = MotionLimits.of(self._robot.motion(attached))

    @property
    def twist(self) -> Twist2:
        """The present target twist."""
        return self._controller.set_point

    @property
    def odometry(self) -> Odometry:
        """Wheel odometry, from the start."""
        return self._controller.odometry

    def observe(self, encoders: Encoders) -> None:
        self._controller.observe(encoders)

    def command(self, time_s: float) -> ModuleSetPoints | None:
        if self._controller.measured_rad is None:
            return None
        if self.stopped:
            self._controller.halt(time_s)
            return None
        return self._controller.step(Command(self._requested(time_s)), self._limits, time_s).modules


def _four(values: Sequence[float]) -> Four:
    a, b, c, d = values
    return a, b, c, d

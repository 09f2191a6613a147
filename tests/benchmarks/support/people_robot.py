"""The robot of the benchmark ``people``: the drive's kernels apply the safety monitor's limit with real delays."""

from __future__ import annotations

from collections import deque

from robot_stack.contract.frames import DRIVE_AXES, JOINTS, STEER_AXES
from robot_stack.contract.topics import WHEEL_COMMANDS
from robot_stack.core.config import load
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Twist2, exp_se2
from robot_stack.core.limits import MotionLimits, SafetyLimit
from robot_stack.core.robot import Robot
from robot_stack.drive.arbitration import Arbiter, Source
from robot_stack.drive.kinematics import ZEROS, ModuleSetPoints
from robot_stack.drive.params import SwerveControllerParams
from robot_stack.drive.permission import Action, Situation, permit
from robot_stack.drive.swerve_drive import SwerveDrive
from robot_stack.safety.arbiter import Verdict

# From a wheel command to the wheels' motion: message, engine cycle, servo. With this value, stopping from 1.0 m/s takes
# 0.29 m, as the benchmark ``stop`` measures on the whole stack with its physics.
ACTUATION_S = 0.04


class DrivenRobot:
    """Kinematic: follows the command of ``ACTUATION_S`` ago. pose: in map, starts at the origin."""

    def __init__(self, robot: Robot, chair: bool) -> None:
        params = load(SwerveControllerParams, "swerve_controller")
        self._drive = SwerveDrive(params, robot)
        self._arbiter = Arbiter()
        self._limits = MotionLimits.of(robot.empty), MotionLimits.of(robot.with_passenger)
        self._standing, self._radius_m, self._chair = params.standing, robot.wheel_radius_m, chair
        self._limit: SafetyLimit | None = None
        self._late: deque[tuple[float, Twist2, ModuleSetPoints]] = deque()
        self._modules = ModuleSetPoints(ZEROS, ZEROS)
        self._turned = [0.0] * len(ZEROS)
        self.pose, self.twist = IDENTITY, ZERO_TWIST

    @property
    def set_point(self) -> Twist2:
        """The drive's set point, as published on /cmd_vel_limited."""
        return self._drive.twist

    def obey(self, verdict: Verdict) -> None:
        """Applies a message of /safety/velocity_limit."""
        self._limit = verdict.limit

    def free(self) -> None:
        """Removes the limit."""
        limits = self._limits[self._chair]
        self._limit = SafetyLimit(limits.speed_mps, limits.yaw_rate_radps)

    def command(self, source: Source, twist: Twist2, now_s: float) -> None:
        self._arbiter.command(source, twist, now_s)

    def tick(self, now_s: float) -> None:
        """One tick of the swerve controller."""
        holder, requested = self._arbiter.requested(now_s)
        situation = Situation(False, True, True, self._limit, True, self._chair, holder, requested)
        permission = permit(situation, *self._limits)
        at_rest = self.twist.speed() <= self._standing.speed_mps
        output = self._drive.step(
            permission.requested,
            permission.limits,
            1.0 / WHEEL_COMMANDS.nominal_rate_hz,
            self._modules.angles_rad,
            standing=at_rest and abs(self.twist.omega) <= self._standing.yaw_rate_radps,
            braking=permission.action is Action.BRAKE,
        )
        self._late.append((now_s + ACTUATION_S, output.twist, output.modules))

    def move(self, now_s: float, dt_s: float) -> None:
        """Moves until ``now_s``."""
        while self._late and self._late[0][0] <= now_s:
            _, self.twist, self._modules = self._late.popleft()
        self.pose = self.pose.compose(exp_se2(self.twist, dt_s))
        for index, speed in enumerate(self._modules.speeds_mps):
            self._turned[index] += speed / self._radius_m * dt_s

    def joint_states(self) -> tuple[list[float], list[float]]:
        """(rad, rad/s) of ``JOINTS``."""
        position, velocity = [0.0] * len(JOINTS), [0.0] * len(JOINTS)
        for module, (drive, steer) in enumerate(zip(DRIVE_AXES, STEER_AXES, strict=True)):
            position[drive], position[steer] = self._turned[module], self._modules.angles_rad[module]
            velocity[drive] = self._modules.speeds_mps[module] / self._radius_m
        return position, velocity

"""The swerve controller without ROS: encoders and a request in, odometry and set points of the modules out."""

from __future__ import annotations

import math

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.core.limits import MotionLimits
from robot_stack.core.robot import Robot
from robot_stack.drive.arbitration import NO_COMMAND, Command
from robot_stack.drive.kinematics import Four
from robot_stack.drive.odometry import Encoders, Odometry, SwerveOdometry
from robot_stack.drive.params import SwerveControllerParams
from robot_stack.drive.permission import Action, Permission
from robot_stack.drive.self_calibration import WheelCalibration
from robot_stack.drive.swerve_drive import DriveOutput, SwerveDrive


class SwerveController:
    """The drive kernel for node, rig and benchmarks: ``observe`` at the encoder rate, ``step`` at the command rate.

    Times are s on any steady clock. The first step has no duration.
    """

    def __init__(self, params: SwerveControllerParams, robot: Robot) -> None:
        self._drive = SwerveDrive(params, robot)
        self._odometry = SwerveOdometry(params.odometry, robot)
        self._standing = params.standing
        self._encoders: Encoders | None = None
        self._stepped_s = math.nan
        self.odometry = Odometry()

    @property
    def measured_rad(self) -> Four | None:
        """Headings of the modules, any number of turns; None before the first encoders."""
        return None if self._encoders is None else self._encoders.steer_rad

    @property
    def set_point(self) -> Twist2:
        """The present set point of the twist, base_link."""
        return self._drive.twist

    @property
    def calibration(self) -> WheelCalibration:
        return self._odometry.calibration

    def observe(self, encoders: Encoders) -> Odometry:
        self._encoders = encoders
        self.odometry = self._odometry.update(encoders)
        return self.odometry

    def standing(self) -> bool:
        """True if the wheels stand."""
        twist, limit = self.odometry.twist, self._standing
        return twist.speed() <= limit.speed_mps and abs(twist.omega) <= limit.yaw_rate_radps

    def halt(self, now_s: float) -> DriveOutput:
        """Commands zero at once; the headings stay."""
        self._stepped_s = now_s
        return self._drive.halt(self.measured_rad)

    def step(self, requested: Command, limits: MotionLimits, now_s: float, *, braking: bool = False) -> DriveOutput:
        """The next set points. braking: to standstill at the emergency deceleration, ignoring ``requested``."""
        elapsed_s, self._stepped_s = now_s - self._stepped_s, now_s
        return self._drive.step(
            requested, limits, elapsed_s, self.measured_rad, standing=self.standing(), braking=braking
        )

    def carry_out(self, permission: Permission, now_s: float) -> DriveOutput:
        """The next set points under ``permission``."""
        if permission.action is Action.HALT:
            return self.halt(now_s)
        braking = permission.action is Action.BRAKE
        return self.step(permission.requested, permission.limits, now_s, braking=braking)

    def begin_braking(self, permission: Permission, period_s: float, now_s: float) -> DriveOutput | None:
        """The set points of a hard stop that begins between two steps; None if none is due, or the robot stands or
        brakes already.

        Set points are reached one ``period_s`` after their command, so this one lies that far ahead. The next
        ``step`` continues from here.
        """
        if permission.action is not Action.BRAKE or not self._drive.may_brake:
            return None
        self._stepped_s = now_s
        return self._drive.step(
            NO_COMMAND, permission.limits, period_s, self.measured_rad, standing=False, braking=True
        )

    def figures(self, output: DriveOutput) -> dict[str, str]:
        """For diagnostics, after the step that brought ``output``."""
        twist, calibration = output.twist, self.calibration
        return {
            "drive": output.state.value,
            "set point": f"{twist.vx:.3f} {twist.vy:.3f} m/s {twist.omega:.3f} rad/s",
            "wheels contradict": str(self.odometry.slipping),
            "wheel radii": ", ".join(f"{100 * error:+.3f} %" for error in calibration.radius_errors),
            "steering zeros": ", ".join(f"{zero:+.5f} rad" for zero in calibration.zero_errors_rad),
        }

    def reset_odometry(self) -> bool:
        """Resets odom to the robot's present pose. False without a reset if it moves."""
        if not self.standing() or self.set_point != ZERO_TWIST:
            return False
        self._odometry.reset()
        self.odometry = Odometry()
        return True

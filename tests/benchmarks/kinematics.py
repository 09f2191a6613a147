"""Time of one step of the swerve controller: arbitration, limits, feasibility, inverse kinematics, desaturation."""

from __future__ import annotations

import math
import time

from robot_stack.core.config import load
from robot_stack.core.geometry import Twist2
from robot_stack.core.limits import MotionLimits, SafetyLimit
from robot_stack.core.robot import load_robot
from robot_stack.drive.arbitration import Arbiter, Source
from robot_stack.drive.kinematics import ZEROS
from robot_stack.drive.params import SwerveControllerParams
from robot_stack.drive.permission import Situation, permit
from robot_stack.drive.swerve_drive import SwerveDrive
from tests.benchmarks.support.framework import Aim, Result, percentile

AIMS = {"step_us_p50": Aim("<", 20.0)}
_TICK_S = 0.05


def course(t_s: float) -> Twist2:
    """A ride with curves, sideways motion, turns, stops, and occasional command steps."""
    if t_s % 40.0 < 4.0:
        return Twist2(0.0, 0.0, 0.0)
    sign = -1.0 if t_s % 40.0 > 30.0 else 1.0
    return Twist2(sign * (0.9 + 0.5 * math.sin(0.7 * t_s)), 0.6 * math.sin(0.9 * t_s), 0.8 * math.sin(0.5 * t_s))


def run(ticks: int = 6000) -> Result:
    """(figures in microseconds, conditions): ``ticks`` steps at 20 Hz of ride time, without pacing."""
    twists = [course(tick * _TICK_S) for tick in range(ticks)]
    steps_us = _controller_us(twists)
    figures = {"step_us_p50": percentile(steps_us, 0.5), "step_us_p99": percentile(steps_us, 0.99)}
    conditions: dict[str, object] = {
        "ticks": ticks,
        "step": "arbitration, permission, all limits, feasibility, inverse kinematics, desaturation",
        "wpilib": "inverse kinematics and desaturation only (C++)",
    }
    try:
        wpilib_us = _wpilib_us(twists)
    except ImportError as error:
        conditions["wpilib"] = f"not measured: {error}"
    else:
        figures["wpilib_us_p50"] = percentile(wpilib_us, 0.5)
    return Result(figures, conditions)


def _controller_us(twists: list[Twist2]) -> list[float]:
    robot, params = load_robot(), load(SwerveControllerParams, "swerve_controller")
    drive = SwerveDrive(params, robot)
    measured = drive.halt(ZEROS).modules.angles_rad
    arbiter = Arbiter()
    empty, with_passenger = MotionLimits.of(robot.empty), MotionLimits.of(robot.with_passenger)
    limit = SafetyLimit(robot.empty.max_speed_mps, robot.empty.max_yaw_rate_radps)
    times = []
    for tick, twist in enumerate(twists):
        now_s = tick * _TICK_S
        start_ns = time.perf_counter_ns()
        arbiter.command(Source.NAVIGATION, twist, now_s)
        holder, requested = arbiter.requested(now_s)
        permission = permit(Situation(False, True, True, limit, True, False, holder, requested), empty, with_passenger)
        output = drive.step(permission.requested, permission.limits, _TICK_S, measured, standing=False)
        times.append((time.perf_counter_ns() - start_ns) * 1e-3)
        measured = output.modules.angles_rad
    return times


def _wpilib_us(twists: list[Twist2]) -> list[float]:
    from wpimath.geometry import Translation2d
    from wpimath.kinematics import ChassisSpeeds, SwerveDrive4Kinematics

    kinematics = SwerveDrive4Kinematics(*(Translation2d(x, y) for x, y in load_robot().module_positions_m()))
    times = []
    for twist in twists:
        start_ns = time.perf_counter_ns()
        states = kinematics.toSwerveModuleStates(ChassisSpeeds(twist.vx, twist.vy, twist.omega))
        SwerveDrive4Kinematics.desaturateWheelSpeeds(states, 1.5)
        times.append((time.perf_counter_ns() - start_ns) * 1e-3)
    return times

"""The engine's parameters for the robot's eight axes, from ``config/robot.yaml``.

User unit: rad at the wheel (drive) and at the steering axis (steer).
"""

from __future__ import annotations

import math
from typing import Final

from robot_stack.contract.frames import JOINTS
from robot_stack.core.robot import Drive, JointAxis, Motor, Robot
from robot_stack.core.runtime import runtime_dir
from robot_stack.wmx.config import VENDOR_DEFAULTS, AxisKind, EngineParameters, EStopSignal, FollowingError, Homing
from robot_stack.wmx.parameter_blocks import file_values
from robot_stack.wmx.simulated.parameter_file import write_file

_FILE: Final = "robot_wmx_parameters.xml"


def robot_parameters(robot: Robot) -> EngineParameters:
    """The parameters of all axes up to the robot's last one; axes that are not the robot's keep the vendor's defaults.

    The safety edge's relay stops the engine without any client. A level 1 stop keeps the servos on.
    """
    axes = [VENDOR_DEFAULTS] * (max(robot.joint_axes) + 1)
    for joint in JOINTS:
        axis, motor = robot.axes[joint], robot.motor(joint)
        axes[axis.number] = _drive(robot, motor, axis) if isinstance(motor, Drive) else _steer(robot, axis)
    edge = robot.safety_edge
    signal = (
        None
        if edge is None
        else EStopSignal(enabled=True, byte=edge.byte, bit=edge.relay_input_bit, active=0, level="level1")
    )
    return EngineParameters(tuple(axes), signal)


def write_parameters(parameters: EngineParameters) -> str:
    """Writes the file that a robot's node imports at its start into the runtime folder. Returns its path.

    Raises ConfigError or OSError.
    """
    path = str(runtime_dir() / _FILE)
    write_file(path, file_values(parameters))
    return path


def _drive(robot: Robot, drive: Drive, axis: JointAxis) -> AxisKind:
    """A wheel turns without end: it has no limits of position, and its alarm is that of its speed."""
    error = FollowingError(
        moving_rad=0.0,
        stopped_rad=0.0,
        velocity_moving_radps=drive.stall_speed_radps,
        velocity_stopped_radps=drive.stall_speed_radps,
        velocity_time_s=drive.stall_time_s,
        quick_stop=True,
    )
    quick_stop = drive.quick_stop_deceleration_mps2 / robot.wheel_radius_m
    estop = robot.emergency_deceleration_mps2 / robot.wheel_radius_m
    return _axis("velocity", drive, axis, quick_stop, estop, error, None)


def _steer(robot: Robot, axis: JointAxis) -> AxisKind:
    steer = robot.steer
    error = FollowingError(
        moving_rad=steer.following_error_rad,
        stopped_rad=steer.following_error_rad,
        velocity_moving_radps=0.0,
        velocity_stopped_radps=0.0,
        velocity_time_s=0.0,
        quick_stop=True,
    )
    quick_stop, estop = steer.quick_stop_deceleration_radps2, steer.emergency_deceleration_radps2
    homing = Homing.model_validate(steer.homing.model_dump())
    return _axis("position", steer, axis, quick_stop, estop, error, homing)


def _axis(
    mode: str,
    motor: Motor,
    axis: JointAxis,
    quick_stop_dec_radps2: float,
    estop_dec_radps2: float,
    error: FollowingError,
    homing: Homing | None,
) -> AxisKind:
    return AxisKind.model_validate(
        {
            "mode": mode,
            "gear_numerator": motor.counts_per_turn,
            "gear_denominator": math.tau,
            "polarity": axis.polarity,
            "absolute_encoder": motor.absolute_encoder,
            "home_offset_rad": axis.zero_rad,
            "in_pos_width_rad": motor.position_width_rad,
            "pos_set_width_rad": motor.position_width_rad,
            "quick_stop_dec_radps2": quick_stop_dec_radps2,
            "estop_dec_radps2": estop_dec_radps2,
            "servo_off_during_alarm": True,
            "following_error": error,
            "soft_limits": None,
            "homing": homing,
        }
    )

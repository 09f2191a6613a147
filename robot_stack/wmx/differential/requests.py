"""Requests about one axis, as the session asks them of the engine."""

from __future__ import annotations

from collections.abc import Callable

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import AxisCommandMode, Profile, Velocity_VelCommand

Request = Callable[[MotionEngine], int]


def velocity_mode(axis: int) -> Request:
    return lambda engine: engine.core_motion.axisControl.SetAxisCommandMode(axis, AxisCommandMode.Velocity)


def quick_stop(axis: int) -> Request:
    """Whichever mode the axis is in: the call of the other one is refused."""

    def request(engine: MotionEngine) -> int:
        return engine.core_motion.velocity.ExecQuickStop(axis) and engine.core_motion.motion.ExecQuickStop(axis)

    return request


def clear_drive(axis: int) -> Request:
    return lambda engine: engine.core_motion.axisControl.ClearAmpAlarm(axis)


def clear_axis(axis: int) -> Request:
    return lambda engine: engine.core_motion.axisControl.ClearAxisAlarm(axis)


def run_at(axis: int, speed_radps: float, acc_time_s: float, dec_time_s: float) -> Velocity_VelCommand:
    """A velocity motion that changes its speed within the given times; the engine counts them in milliseconds."""
    profile = Profile.SetupTimeAccTrapezoidal(speed_radps, 1e3 * acc_time_s, 1e3 * dec_time_s)
    return Velocity_VelCommand(axis, profile)

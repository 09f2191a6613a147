"""Joints and gripper in a status of the engine."""

from __future__ import annotations

from math import isfinite

from robot_stack.wmx.axes import AxisFeedback
from robot_stack.wmx.manipulator.params import N_FINGERS, ManipulatorStateParams


def read(feedback: AxisFeedback, params: ManipulatorStateParams) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
    """Measured positions (rad) and velocities (rad/s), one per name; a finger's velocity is 0.

    The gripper's output bit is 1 while it is closed. None if a joint's value is not finite.
    """
    n = params.joint_number
    position, velocity = feedback.position[:n], feedback.velocity[:n]
    if not isfinite(sum(position) + sum(velocity)):
        return None
    closed = feedback.output_bit(params.gripper_byte, params.gripper_bit)
    finger = params.gripper_close_value if closed else params.gripper_open_value
    return position + (finger,) * N_FINGERS, velocity + (0.0,) * N_FINGERS

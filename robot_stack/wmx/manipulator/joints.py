"""Joints and gripper in a status of the engine."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

import numpy as np

from robot_stack.wmx.axes import AxisFeedback, StatusSnapshot


@dataclass(frozen=True, slots=True)
class JointSettings:
    """names: the joints' in the order of the axes, then the fingers'. n_joints: joint j is axis j. The output bit is 1
    for a closed gripper; the finger positions are those of either end.
    """

    names: tuple[str, ...]
    n_joints: int
    gripper_byte: int
    gripper_bit: int
    finger_open: float
    finger_closed: float


def read(feedback: AxisFeedback, settings: JointSettings) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
    """Measured positions (rad) and velocities (rad/s), one per name; a finger's velocity is 0.

    None if a joint's value is not finite.
    """
    n = settings.n_joints
    position, velocity = feedback.position[:n], feedback.velocity[:n]
    if not isfinite(sum(position) + sum(velocity)):
        return None
    closed = feedback.output_bit(settings.gripper_byte, settings.gripper_bit)
    finger = settings.finger_closed if closed else settings.finger_open
    fingers = len(settings.names) - n
    return position + (finger,) * fingers, velocity + (0.0,) * fingers


def faults(snapshot: StatusSnapshot, settings: JointSettings, servos: bool) -> str:
    """Alarms and, if ``servos`` must be on, those that are off, as one text; empty if there are none."""
    names, n = settings.names, settings.n_joints
    alarms = [
        f"{names[axis]} amplifier alarm {int(snapshot.amp_alarm_code[axis])}"
        for axis in np.flatnonzero(snapshot.amp_alarm[:n])
    ]
    following = [f"{names[axis]} following error" for axis in np.flatnonzero(snapshot.following_error_alarm[:n])]
    off = [names[axis] for axis in np.flatnonzero(~snapshot.servo_on[:n])] if servos else []
    return ", ".join([*alarms, *following, *([f"servo off: {' '.join(off)}"] if off else [])])

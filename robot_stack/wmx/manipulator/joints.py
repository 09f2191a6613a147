"""Joints and gripper in a status of the engine."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.axes import Real, StatusSnapshot


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


def fill(
    snapshot: StatusSnapshot, settings: JointSettings, position: NDArray[np.float64], velocity: NDArray[np.float64]
) -> bool:
    """Puts measured positions (rad) and velocities (rad/s) of joints and fingers into the two arrays.

    Both have one entry per name; the fingers' velocities stay as they are, 0. False if a value is not finite.
    """
    n = settings.n_joints
    position[:n] = snapshot.reals[Real.ACTUAL_POS, :n]
    velocity[:n] = snapshot.reals[Real.ACTUAL_VELOCITY, :n]
    closed = snapshot.output_bit(settings.gripper_byte, settings.gripper_bit)
    position[n:] = settings.finger_closed if closed else settings.finger_open
    return math.isfinite(position.sum() + velocity.sum())


def faults(snapshot: StatusSnapshot, settings: JointSettings, servos: bool) -> str:
    """Alarms and, if ``servos`` are to be on, those that are off, as one text; empty if there are none."""
    names, n = settings.names, settings.n_joints
    alarms = [
        f"{names[axis]} amplifier alarm {int(snapshot.amp_alarm_code[axis])}"
        for axis in np.flatnonzero(snapshot.amp_alarm[:n])
    ]
    following = [f"{names[axis]} following error" for axis in np.flatnonzero(snapshot.following_error_alarm[:n])]
    off = [names[axis] for axis in np.flatnonzero(~snapshot.servo_on[:n])] if servos else []
    return ", ".join([*alarms, *following, *([f"servo off: {' '.join(off)}"] if off else [])])

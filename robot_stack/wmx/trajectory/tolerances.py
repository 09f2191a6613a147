"""Tolerances of a goal, with the meaning of control_msgs/JointTolerance: 0 is the default, -1 no limit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.trajectory.results import GoalCode, GoalRefused

FloatArray = NDArray[np.float64]
_UNLIMITED = -1.0


@dataclass(frozen=True, slots=True)
class JointTolerance:
    """A client's tolerance; rad, rad/s, rad/s^2."""

    name: str
    position: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Per joint in the order of the axes; infinite where nothing is limited. Accelerations are not measured, and so
    cannot be judged.
    """

    position: FloatArray
    velocity: FloatArray

    @staticmethod
    def none(n_joints: int) -> Tolerances:
        return Tolerances(np.full(n_joints, np.inf), np.full(n_joints, np.inf))


def resolve(
    field: str,
    tolerances: Sequence[JointTolerance],
    joints: tuple[str, ...],
    default_position_rad: float,
    default_velocity_radps: float = 0.0,
) -> Tolerances:
    """The tolerances in force. A default of 0 means no limit. Raises GoalRefused."""
    resolved = Tolerances.none(len(joints))
    if default_position_rad > 0.0:
        resolved.position[:] = default_position_rad
    if default_velocity_radps > 0.0:
        resolved.velocity[:] = default_velocity_radps
    for tolerance in tolerances:
        if tolerance.name not in joints:
            raise GoalRefused(GoalCode.INVALID_JOINTS, f"{field}: unknown joint {tolerance.name!r}")
        axis = joints.index(tolerance.name)
        for what in ("position", "velocity", "acceleration"):
            value = getattr(tolerance, what)
            if not math.isfinite(value) or (value < 0.0 and value != _UNLIMITED):
                raise GoalRefused(
                    GoalCode.INVALID_GOAL,
                    f"{field}: {what} of {tolerance.name} is {value:g}; legal are 0 (default), -1 (no limit) and more",
                )
            if value != 0.0 and what != "acceleration":
                getattr(resolved, what)[axis] = np.inf if value == _UNLIMITED else value
    return resolved


def violation(
    tolerances: Tolerances, position_error: FloatArray, velocity_error: FloatArray, joints: tuple[str, ...]
) -> str:
    """Description of the joint furthest out of its tolerance; empty if there is none."""
    worst, text = 1.0, ""
    for what, unit, errors, limits in (
        ("position", "rad", position_error, tolerances.position),
        ("velocity", "rad/s", velocity_error, tolerances.velocity),
    ):
        share = np.abs(errors) / limits
        axis = int(np.argmax(share))
        if share[axis] > worst:
            worst = float(share[axis])
            text = f"{joints[axis]}: {what} error {errors[axis]:+.5f} {unit}, tolerance {limits[axis]:g} {unit}"
    return text

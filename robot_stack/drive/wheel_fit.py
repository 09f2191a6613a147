"""The rigid motion that fits the wheels' displacements best, and the wheels that do not fit.

Each module reports two rows, the x and y of its displacement in base_link: d_i = t + theta * (-y_i, x_i). With both
components the eight rows always determine the three unknowns, also in straight driving, where the wheel speeds alone do
not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robot_stack.core.geometry import Twist2
from robot_stack.core.rigid_motion import Vectors, residuals, rigid_fit
from robot_stack.drive.kinematics import Positions

_ALL = (0, 1, 2, 3)
# An inconsistent wheel can only be identified if three others agree.
_FEWEST_TO_AGREE = 3


@dataclass(frozen=True, slots=True)
class WheelFit:
    """motion: displacement of the body (m, m, rad), base_link. used: modules of the fit. rms_m: residual of
    those. consistent: the used modules agree within the tolerance.
    """

    motion: Twist2
    used: tuple[int, ...]
    rms_m: float
    consistent: bool


def robust_fit(
    positions: Positions, displacements: Vectors, tolerance_m: float, plausible: Sequence[int] = _ALL
) -> WheelFit:
    """The fit of the modules that agree within ``tolerance_m``.

    If the given modules disagree and leaving one of them out makes the others agree, it is left out. If no such
    module exists, all are used and the result is marked inconsistent: more than one wheel slips. At least two modules
    must be given.
    """
    best = _fit(positions, displacements, tuple(plausible), tolerance_m)
    if best.consistent or len(plausible) <= _FEWEST_TO_AGREE:
        return best
    rests = [tuple(i for i in plausible if i != out) for out in plausible]
    candidates = [_fit(positions, displacements, rest, tolerance_m) for rest in rests]
    agreeing = min(candidates, key=lambda candidate: candidate.rms_m)
    return agreeing if agreeing.consistent else best


def _fit(positions: Positions, displacements: Vectors, modules: tuple[int, ...], tolerance_m: float) -> WheelFit:
    motion = rigid_fit([positions[i] for i in modules], [displacements[i] for i in modules])
    errors = residuals(positions, displacements, motion)
    largest = max(errors[i] for i in modules)
    # Rows less unknowns: the degrees of freedom that are left for the error.
    freedom = 2 * len(modules) - 3
    rms = math.sqrt(sum(errors[i] ** 2 for i in modules) / freedom)
    return WheelFit(motion, modules, rms, largest <= tolerance_m)

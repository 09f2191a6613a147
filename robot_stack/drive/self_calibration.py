"""Online calibration of wheel radii and steering zeros against their nominal values.

Four wheels give eight rows, a rigid body needs three: the other five show which wheel is larger than the others and
which heading is off: d = (1 - e) R(z) d' for a wheel whose radius is larger by the share e and whose steering encoder
reads z too much. A recursive least squares over those five rows estimates the differences between the wheels, as far
as the motion excites them: straight motion alone leaves a turn open, motion in several directions nothing. Errors
common to all wheels are not observable and are held at zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.drive.interval import four
from robot_stack.drive.kinematics import ZEROS, Four, Positions
from robot_stack.drive.params import CalibrationParams

_MODULES = 4
_UNKNOWN = 2 * _MODULES
_SPARE = 5  # rows of a reading that a rigid motion leaves
# Prior standard deviation of the error common to all wheels: held at zero.
_COMMON = 1e-6
# An estimate beyond this many standard deviations of the prior is not a manufacturing tolerance.
_BOUND = 4.0


@dataclass(frozen=True, slots=True)
class Learnt:
    """The calibration of a ride, with standard deviations. radius_*: relative. readings: number of used ones.

    unlike_m, left_m: rms residual of a wheel's displacement against a rigid motion, without and with the correction.
    """

    radius_errors: Four
    radius_deviations: Four
    zero_errors_rad: Four
    zero_deviations_rad: Four
    readings: int
    unlike_m: float
    left_m: float


class WheelCalibration:
    """The present estimate. radius_errors: relative, positive for a larger wheel. zero_errors_rad: offset of the
    steering encoders.
    """

    def __init__(self, positions: Positions, params: CalibrationParams) -> None:
        self._params = params
        self._projector = _beside_rigid_motion(positions)
        self._information = _prior(params)
        self._evidence: NDArray[np.float64] = np.zeros(_UNKNOWN)
        self._deviations = np.repeat([params.radius_deviation, params.zero_deviation_rad], _MODULES)
        self._estimate: NDArray[np.float64] = np.zeros(_UNKNOWN)
        self._readings = 0
        self._seen_m2 = 0.0
        self.radius_errors: Four = ZEROS
        self.zero_errors_rad: Four = ZEROS

    def observe(self, displacements: Sequence[tuple[float, float]]) -> None:
        """Updates the estimate by the wheels' displacements (m, base_link), corrected by the present one."""
        rows = np.array(displacements).ravel()
        if np.abs(rows).max() < self._params.least_way_m:
            return
        effect = self._projector @ _effects(rows)
        # The rows without the present correction.
        seen = self._projector @ rows + effect @ self._estimate
        weight = self._params.noise_m**-2
        self._information += weight * (effect.T @ effect)
        self._evidence += weight * (effect.T @ seen)
        self._readings += 1
        self._seen_m2 += float(seen @ seen)
        if self._readings % self._params.readings_per_update == 0:
            self._solve()

    def learnt(self) -> Learnt:
        """The calibration from all readings so far."""
        self._solve()
        deviations = np.sqrt(np.diagonal(np.linalg.inv(self._information))).tolist()
        weight, e = self._params.noise_m**-2, self._estimate
        gained = (self._information - _prior(self._params)) / weight
        left_m2 = self._seen_m2 - 2.0 * float(e @ self._evidence) / weight + float(e @ gained @ e)
        rows = max(1, _SPARE * self._readings)
        return Learnt(
            self.radius_errors,
            four(deviations[:_MODULES]),
            self.zero_errors_rad,
            four(deviations[_MODULES:]),
            self._readings,
            math.sqrt(self._seen_m2 / rows),
            math.sqrt(max(0.0, left_m2) / rows),
        )

    def _solve(self) -> None:
        bound = _BOUND * self._deviations
        estimate = np.linalg.solve(self._information, self._evidence)
        self._estimate = np.clip(estimate, -bound, bound)
        values = self._estimate.tolist()
        self.radius_errors = values[0], values[1], values[2], values[3]
        self.zero_errors_rad = values[4], values[5], values[6], values[7]


def _beside_rigid_motion(positions: Positions) -> NDArray[np.float64]:
    """(8, 8) projector of the wheels' rows onto the complement of rigid motions."""
    rigid = np.array([row for x, y in positions for row in ((1.0, 0.0, -y), (0.0, 1.0, x))])
    return np.asarray(np.eye(_UNKNOWN) - rigid @ np.linalg.pinv(rigid))


def _prior(params: CalibrationParams) -> NDArray[np.float64]:
    information = np.zeros((_UNKNOWN, _UNKNOWN))
    together = np.ones((_MODULES, _MODULES)) / (_MODULES * _COMMON) ** 2
    for start, deviation in ((0, params.radius_deviation), (_MODULES, params.zero_deviation_rad)):
        block = slice(start, start + _MODULES)
        information[block, block] = np.eye(_MODULES) / deviation**2 + together
    return information


def _effects(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """(8, 8) change of the rows by each unknown: a larger wheel reports too little distance, a zero rotates it."""
    effects = np.zeros((_UNKNOWN, _UNKNOWN))
    modules = np.arange(_MODULES)
    x, y = rows[0::2], rows[1::2]
    effects[2 * modules, modules] = -x
    effects[2 * modules + 1, modules] = -y
    effects[2 * modules, _MODULES + modules] = -y
    effects[2 * modules + 1, _MODULES + modules] = x
    return effects

"""Checks of a spline command, before those of its axes. Each function returns an error code, 0 for success."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.api.errors import AdvancedMotionErrorCode, CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.api.values import MAX_SPLINE_DIMENSIONS
from robot_stack.wmx.engine_server.checks import LARGEST, LARGEST_COUNT, axes_in_range

CLOSEST_MS: Final = 1e-3
"""Least time between two points."""
_ROUNDING_MS: Final = 1e-9


def spline_axes(axes: Sequence[int], n_axes: int) -> int:
    """Each existing, none twice, no more than a spline may have."""
    code = axes_in_range(axes, n_axes) if axes else ErrorCode.PyNone
    if code:
        return code
    good = 1 <= len(axes) <= MAX_SPLINE_DIMENSIONS
    return ErrorCode.PyNone if good else AdvancedMotionErrorCode.DimensionOutOfRange


def exact_counts(
    positions: NDArray[np.float64] | float, counts_per_unit: NDArray[np.float64], home_offset: NDArray[np.float64]
) -> int:
    """Positions (..., axes) whose encoder counts are exact."""
    with np.errstate(over="ignore"):
        exact = np.abs((positions + home_offset) * counts_per_unit) < LARGEST_COUNT  # False for NaN
    return ErrorCode.PyNone if exact.all() else CoreMotionErrorCode.PositionArgumentOutOfRange


def point_times(times_ms: NDArray[np.float64]) -> int:
    """Finite, ascending from 0, none too close to the one before; the first may be 0."""
    if not (np.isfinite(times_ms) & (times_ms >= 0.0) & (times_ms <= LARGEST)).all():
        return CoreMotionErrorCode.TimeArgumentOutOfRange
    gaps = np.diff(times_ms, prepend=0.0)
    if gaps.size and times_ms[0] == 0.0:
        gaps = gaps[1:]
    close = gaps < CLOSEST_MS - _ROUNDING_MS
    return AdvancedMotionErrorCode.TimeBetweenPointsTooClose if close.any() else ErrorCode.PyNone

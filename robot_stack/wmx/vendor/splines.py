"""AdvancedMotion on the vendor's library: the first spline determines the type of its times."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from robot_stack.wmx.api import surface
from robot_stack.wmx.api.errors import AdvancedMotionErrorCode, CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.api.values import (
    MAX_SPLINE_DIMENSIONS,
    AdvMotion_PointTimeSplineCommand,
    AdvMotion_SplinePoint,
)
from robot_stack.wmx.vendor.adapter import Module
from robot_stack.wmx.vendor.member import WRONG_ARGUMENTS, Member
from robot_stack.wmx.vendor.records import Records


class AdvMotion(Member):
    """advMotion. The times of a spline are a list of floats, a doubleArray, or a uintArray of whole milliseconds."""

    def __init__(self, theirs: Any, records: Records) -> None:
        super().__init__(theirs, surface.ADV_MOTION, records)
        self._start = self.bound("StartCSplinePos_PointTime", surface.ADV_MOTION["StartCSplinePos_PointTime"])
        self._shapes = [self._list, self._doubles, self._uints]

    def StartCSplinePos_PointTime(
        self,
        channel: int,
        command: AdvMotion_PointTimeSplineCommand,
        numPoints: int,
        points: Sequence[AdvMotion_SplinePoint],
        pointTimeMilliseconds: Sequence[float],
    ) -> int:
        if not numPoints == len(points) == len(pointTimeMilliseconds):
            return ErrorCode.ArgumentOutOfRange
        if command.dimensionCount > MAX_SPLINE_DIMENSIONS:
            return AdvancedMotionErrorCode.DimensionOutOfRange
        refused: Exception | None = None
        for shape in list(self._shapes):
            times = shape([float(time_ms) for time_ms in pointTimeMilliseconds])
            if times is None:
                continue
            if isinstance(times, int):
                return times
            try:
                code: int = self._start(channel, command, numPoints, list(points), times)
            except WRONG_ARGUMENTS as error:
                refused = error
                continue
            self._shapes = [shape]
            return code
        if refused is not None and len(self._shapes) == 1:
            raise refused
        return ErrorCode.NoSupportedFunction

    def _list(self, times_ms: list[float]) -> Any:
        return times_ms

    def _doubles(self, times_ms: list[float]) -> Any:
        return self._array("doubleArray", times_ms)

    def _uints(self, times_ms: list[float]) -> Any:
        """Rounded; points in the same millisecond are refused, as the engine would."""
        try:
            whole = [round(time_ms) for time_ms in times_ms]
        except (ValueError, OverflowError):  # NaN and infinity
            return int(CoreMotionErrorCode.TimeArgumentOutOfRange)
        if min(whole, default=0) < 0:
            return int(CoreMotionErrorCode.TimeArgumentOutOfRange)
        if any(after <= before for before, after in pairwise(whole)):
            return int(AdvancedMotionErrorCode.TimeBetweenPointsTooClose)
        return self._array("uintArray", whole)

    def _array(self, kind: str, values: Sequence[float]) -> Any:
        maker = getattr(self.records.module, kind, None)
        if maker is None:
            return None
        array = maker(len(values))
        for index, value in enumerate(values):
            array[index] = value
        return array


class AdvancedMotion(Module):
    """AdvancedMotion."""

    def __init__(self, theirs: Any, records: Records) -> None:
        super().__init__(theirs, {}, records)
        self.advMotion = AdvMotion(theirs.advMotion, records)

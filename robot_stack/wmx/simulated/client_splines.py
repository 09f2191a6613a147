"""Splines on the simulated engine, as its clients start them."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import TYPE_CHECKING

from robot_stack.wmx.api.errors import AdvancedMotionErrorCode, CoreMotionErrorCode, ErrorCode, error_text
from robot_stack.wmx.api.values import (
    MAX_SPLINE_DIMENSIONS,
    AdvMotion_PointTimeSplineCommand,
    AdvMotion_SplinePoint,
)
from robot_stack.wmx.simulated.protocol import pack

if TYPE_CHECKING:
    from robot_stack.wmx.simulated.client import WMX3Api


class AdvMotion:
    """Spline buffers and spline motions."""

    def __init__(self, api: WMX3Api) -> None:
        self._api = api

    def CreateSplineBuffer(self, channel: int, points: int) -> int:
        return self._api.command("CreateSplineBuffer", operator.index(channel), operator.index(points))

    def FreeSplineBuffer(self, channel: int) -> int:
        return self._api.command("FreeSplineBuffer", operator.index(channel))

    def GetSplineBufferPoints(self, channel: int) -> tuple[int, int]:
        code, values = self._api.call("GetSplineBufferPoints", operator.index(channel))
        return (code, 0) if code else (code, values[0])

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
        n = operator.index(command.dimensionCount)
        if n > MAX_SPLINE_DIMENSIONS:
            n = 0  # which the engine refuses, after what it looks at first
        axes = [command.GetAxis(dimension) for dimension in range(n)]
        rows = [[float(point.GetPos(dimension)) for dimension in range(n)] for point in points]
        times = [float(time) for time in pointTimeMilliseconds] if n > 0 else []
        return self._api.command("StartCSplinePosPointTime", operator.index(channel), axes, pack(rows), pack(times))


class AdvancedMotion:
    """Motions of several axes together on the simulated engine."""

    def __init__(self, api: WMX3Api) -> None:
        self.advMotion = AdvMotion(api)

    @staticmethod
    def ErrorToString(code: int) -> str:
        return error_text(code, AdvancedMotionErrorCode, CoreMotionErrorCode, ErrorCode)

"""Spline motions of the simulated engine: buffers, checks, start and stop. The curve itself is in the spline kernel.

All axes of a spline share one path time. A stop of any of them, by any command, brings all of them to rest along
the path; an axis that leaves it by a fault (alarm, servo off, limit) ends by the rule of that fault and the others stop
along the path. An emergency stop takes every axis off the path, each at its own emergency deceleration.

A stop along the path uses no more than the greatest acceleration of the whole spline, of all axes together
(WMX3 API reference, StartCSplinePos: about that); a quick stop and a fault, than the axis' quick-stop deceleration.
Exactly: see the spline kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from robot_stack.wmx.api.enums import DetailOperationState, OperationState
from robot_stack.wmx.api.errors import AdvancedMotionErrorCode, CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.api.values import MAX_SPLINE_CHANNELS
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.engine_server import rows
from robot_stack.wmx.engine_server.spline_checks import exact_counts, point_times, spline_axes
from robot_stack.wmx.engine_server.spline_kernel import (
    FALL,
    N_CLOCK,
    N_COUNT,
    RATE,
    STOPPING,
    drop_repeated,
    plan_spline,
    step_spline,
)
from robot_stack.wmx.engine_server.state import EngineArrays, Ints, Reals

LARGEST_BUFFER: Final = 100_000
"""Points of one channel."""

_NO_ERROR = int(ErrorCode.PyNone)


@dataclass(slots=True)
class _Run:
    """A spline under way; ``mark`` is its channel + 1 and stands in the work row of each axis that is on it."""

    mark: int
    axes: list[int]
    times: Reals
    curve: Reals
    goal: Reals
    bounds: Reals
    greatest: float
    axis_array: Ints
    clock: Reals = field(default_factory=lambda: np.zeros(N_CLOCK))
    count: Ints = field(default_factory=lambda: np.zeros(N_COUNT, np.int64))
    on_path: int = 0


class Splines:
    """Channels and their running splines.

    ``startable`` returns why axes cannot start in given directions, (axis, direction) each; 0 for no reason.
    """

    def __init__(
        self, arrays: EngineArrays, cycle_time_s: float, startable: Callable[[Sequence[tuple[int, float]]], int]
    ) -> None:
        self._a = arrays
        self._cycle_s = cycle_time_s
        self._startable = startable
        self._buffers: dict[int, int] = {}
        self._runs: dict[int, _Run] = {}

    # -- buffers -------------------------------------------------------------------------------------------------------

    def create(self, channel: int, points: int) -> int:
        """CreateSplineBuffer."""
        if not 0 <= channel < MAX_SPLINE_CHANNELS:
            return ErrorCode.ChannelOutOfRange
        if channel in self._buffers:
            return CoreMotionErrorCode.ChannelBufferMemoryAlreadyAllocated
        if points < 1:
            return ErrorCode.ArgumentOutOfRange
        if points > LARGEST_BUFFER:
            return CoreMotionErrorCode.ChannelBufferMemoryFailedToAllocate
        self._buffers[channel] = points
        return _NO_ERROR

    def free(self, channel: int) -> int:
        """FreeSplineBuffer; not while a spline runs on it."""
        code = self._allocated(channel)
        if not code:
            del self._buffers[channel]
        return code

    def points(self, channel: int) -> tuple[int, int]:
        """GetSplineBufferPoints: (code, points)."""
        if not 0 <= channel < MAX_SPLINE_CHANNELS:
            return ErrorCode.ChannelOutOfRange, 0
        if channel not in self._buffers:
            return CoreMotionErrorCode.ChannelBufferMemoryNotAllocated, 0
        return _NO_ERROR, self._buffers[channel]

    def clear(self) -> None:
        """Drops every spline and every buffer: the engine ends."""
        self._runs.clear()
        self._buffers.clear()

    def forget_runs(self) -> None:
        """Drops all running splines: the motion of all axes has been cancelled."""
        self._runs.clear()

    def _allocated(self, channel: int) -> int:
        code, _ = self.points(channel)
        return code or (CoreMotionErrorCode.ChannelExecutingCommands if channel + 1 in self._runs else _NO_ERROR)

    # -- start ---------------------------------------------------------------------------------------------------------

    def start(self, device: int, channel: int, axes: Sequence[int], points: Reals, times_ms: Reals) -> int:
        """StartCSplinePos with point times; ``points`` (n, dimensions), ``times_ms`` (n,)."""
        code = (
            spline_axes(axes, self._a.n_axes)
            or self._allocated(channel)
            or self._roomy(channel, len(times_ms))
            or self._exact(axes, points)
            or point_times(times_ms)
        )
        if code:
            return code
        first = 1 if len(times_ms) and times_ms[0] == 0.0 else 0
        here = self._a.reals[Real.POS_CMD, list(axes)]
        knots = np.concatenate(([0.0], 1e-3 * times_ms[first:]))
        path = np.ascontiguousarray(np.vstack((here, points[first:])))
        n = drop_repeated(knots, path)
        if n < 2:
            return AdvancedMotionErrorCode.PointCountBelowMinimum
        code = self._startable(list(zip(axes, (path[1] - path[0]).tolist(), strict=True)))
        if code:
            return code
        return self._begin(device, channel, axes, knots[:n].copy(), path[:n].copy())

    def _roomy(self, channel: int, count: int) -> int:
        return CoreMotionErrorCode.ChannelNotEnoughSpace if count > self._buffers[channel] else _NO_ERROR

    def _exact(self, axes: Sequence[int], positions: Reals | float) -> int:
        chosen = list(axes)
        scale, offset = self._a.params[rows.COUNTS_PER_UNIT, chosen], self._a.reals[Real.HOME_OFFSET, chosen]
        return exact_counts(positions, scale, offset)

    def _begin(self, device: int, channel: int, axes: Sequence[int], times: Reals, points: Reals) -> int:
        a, chosen = self._a, list(axes)
        n, d = points.shape
        curve = np.empty((n - 1, d, 4))
        farthest = plan_spline(times, points, curve)
        code = self._exact(chosen, farthest) or self._exact(chosen, -farthest)
        if code:
            return code
        bounds = a.params[rows.QUICK_STOP_DEC, chosen]
        axis_array = np.array(chosen, np.int64)
        greatest = _greatest_acceleration(times, curve)
        run = _Run(channel + 1, chosen, times, curve, points[-1].copy(), bounds, greatest, axis_array, on_path=d)
        run.clock[RATE] = 1.0
        for j, axis in enumerate(chosen):
            self._begin_axis(axis, run, device, float(run.goal[j]))
        self._runs[run.mark] = run
        return _NO_ERROR

    def _begin_axis(self, axis: int, run: _Run, device: int, goal: float) -> None:
        a = self._a
        a.params[rows.PROFILE_DEC, axis] = run.greatest
        a.params[rows.PROFILE_DEC_TIME, axis] = 0.0
        a.work[rows.RUN_CYCLES, axis] = 0
        a.work[rows.SERVO_OFF_AT_REST, axis] = 0
        a.work[rows.SPLINE, axis] = run.mark
        a.reals[Real.PROFILE_TARGET_POS, axis] = goal
        a.reals[Real.PROFILE_REMAINING_MS, axis] = 1e3 * float(run.times[-1])
        flags = a.flags
        flags[Flag.OP_STATE, axis] = OperationState.Intpl
        flags[Flag.DETAIL_OP_STATE, axis] = DetailOperationState.Intpl_Spline
        for row in (Flag.MOTION_COMPLETE, Flag.CMD_DISTRIBUTION_END, Flag.IN_POS, Flag.POS_SET, Flag.END_REASON):
            flags[row, axis] = 0
        flags[Flag.OWNER, axis] = device

    # -- stop ----------------------------------------------------------------------------------------------------------

    def carries(self, axis: int) -> bool:
        """The axis is on a spline."""
        return bool(self._a.work[rows.SPLINE, axis])

    def stop(self, axis: int, dec: float, detail: DetailOperationState) -> None:
        """Brings the spline that carries ``axis`` to rest along its path, this axis at no more than ``dec``."""
        run = self._runs[int(self._a.work[rows.SPLINE, axis])]
        own = detail is DetailOperationState.Stop
        run.bounds[:] = run.greatest if own else self._a.params[rows.QUICK_STOP_DEC, run.axes]
        run.bounds[run.axes.index(axis)] = dec
        self._stop(run, 0.0, detail, _NO_ERROR)

    def _stop(self, run: _Run, fall: float, detail: DetailOperationState, reason: int) -> None:
        run.clock[FALL] = fall
        run.count[STOPPING] = 1
        flags = self._a.flags
        for axis in run.axes:
            if self._a.work[rows.SPLINE, axis] == run.mark:
                flags[Flag.OP_STATE, axis] = OperationState.Stop
                flags[Flag.DETAIL_OP_STATE, axis] = detail
                if reason:
                    flags[Flag.END_REASON, axis] = reason

    # -- cycle ---------------------------------------------------------------------------------------------------------

    def advance(self) -> None:
        """One cycle of every spline, before that of the axes."""
        for run in list(self._runs.values()):
            ended = step_spline(
                self._a,
                run.times,
                run.curve,
                run.goal,
                run.axis_array,
                run.bounds,
                run.clock,
                run.count,
                run.mark,
                self._cycle_s,
            )
            if ended:
                del self._runs[run.mark]

    def watch(self) -> None:
        """Stops the rest of a spline that an axis has left. Call after the feedback of a cycle."""
        for run in list(self._runs.values()):
            on_path = [axis for axis in run.axes if self._a.work[rows.SPLINE, axis] == run.mark]
            if len(on_path) == run.on_path:
                continue
            run.on_path = len(on_path)
            if not on_path:
                del self._runs[run.mark]
                continue
            run.bounds[:] = self._a.params[rows.QUICK_STOP_DEC, run.axes]
            reasons = (self._why(axis) for axis in run.axes if axis not in on_path)
            self._stop(run, 0.0, DetailOperationState.Stop_QStop, next(filter(None, reasons), _NO_ERROR))

    def _why(self, axis: int) -> int:
        """The cause that took an axis off its path; an alarm takes precedence over the servo that it drops."""
        flags = self._a.flags
        alarm = flags[Flag.AMP_ALARM, axis] or flags[Flag.FOLLOWING_ERROR_ALARM, axis]
        return int(ErrorCode.AxisAmpAlarm) if alarm else int(flags[Flag.END_REASON, axis])

    def warm_up(self) -> None:
        """Runs every compiled function once, on axis 0, whose state is worthless afterwards."""
        times, points = np.array([0.0, 1.0, 2.0]), np.array([[0.0], [1.0], [0.0]])
        count = drop_repeated(times, points)
        self._begin(0, 0, [0], times[:count].copy(), points[:count].copy())
        self.advance()
        self.stop(0, 1.0, DetailOperationState.Stop)
        self.advance()
        self._runs.clear()


def _greatest_acceleration(times: Reals, curve: Reals) -> float:
    """The greatest acceleration of all axes together, anywhere on the path: it is linear between the points."""
    begin = 2.0 * curve[:, :, 2]
    end = begin + 6.0 * curve[:, :, 3] * np.diff(times)[:, None]
    return float(np.linalg.norm(np.stack((begin, end)), axis=2).max())

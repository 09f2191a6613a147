"""Converts another vendor's cloud to a sweep of the contract."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.point_cloud import SWEEP, Points, xyz_of
from robot_stack.drivers.counters import Counters
from robot_stack.drivers.point_cloud.cloud import Cloud, CloudRefused, columns_at
from robot_stack.drivers.point_cloud.layouts import Layout, check_unit, recognise
from robot_stack.drivers.point_cloud.params import PointCloudAdapterParams
from robot_stack.drivers.point_cloud.rings import RingOrder, renumbered, ring_order
from robot_stack.drivers.point_cloud.stamps import (
    Limits,
    PointTimes,
    StampAt,
    check_arrival,
    check_span,
    newest_s,
    stamp_at,
)
from robot_stack.drivers.sweep import F64, turning

LOST, DOUBLED, REFUSED, OUT_OF_ORDER = "sweeps lost", "sweeps doubled", "sweeps refused", "sweeps out of order"
_HIGHEST_INTENSITY = 255.0


@dataclass(frozen=True, slots=True)
class Sweep:
    """points: ``SWEEP``, in the order of time. stamp_s: the newest point's time. empty: how many had no return."""

    points: Points
    stamp_s: float
    layout: str
    stamp_at: StampAt
    empty: int


class PointCloudAdapter:
    """period_s, rings: the sensor's, of ``config/robot.yaml``. Keeps what earlier clouds have shown of the driver.

    mounted: (3, 3) from the sensor's own axes to those of the frame that its points are published in, None if they are
    the same.
    """

    def __init__(
        self, params: PointCloudAdapterParams, period_s: float, rings: int, mounted: F64 | None = None
    ) -> None:
        self._params = params
        self._limits = Limits(period_s, params.stamp_tolerance_s, params.future_s, params.oldest_s)
        self._rings = rings
        self._configured = StampAt(params.stamp_at)
        self._turned = turning(params.rpy_deg, mounted)
        self._newest_s: float | None = None
        self.ring_order: RingOrder | None = None
        self.counters = Counters(LOST, DOUBLED, OUT_OF_ORDER, REFUSED)

    def convert(self, cloud: Cloud, arrival_s: float) -> Sweep:
        """The sweep of a cloud that arrived at ``arrival_s`` by this computer's clock.

        Raises CloudRefused, after which the next cloud may be fine; every outcome is counted.
        """
        try:
            sweep = self._converted(cloud, arrival_s)
        except CloudRefused:
            self.counters.add(REFUSED)
            raise
        self._follow(sweep.stamp_s, arrival_s)
        return sweep

    def _converted(self, cloud: Cloud, arrival_s: float) -> Sweep:
        if cloud.frame_id != self._params.frame_id:
            raise CloudRefused(f"frame_id is {cloud.frame_id!r}, expected {self._params.frame_id!r}")
        layout, fields = recognise(cloud, self._params.layout)
        there = columns_at(cloud, fields)
        seconds, times = _times(layout, there["time"])
        check_span(times, self._limits)
        at = stamp_at(times, cloud.stamp_s, arrival_s, self._configured, self._limits)
        stamp_s = newest_s(times, cloud.stamp_s, at)
        check_arrival(stamp_s, arrival_s, self._limits)
        if self._configured is StampAt.AUTO and not times.absolute and at is StampAt.LAST and times.first_s >= 0.0:
            self._configured = StampAt.LAST  # one cloud has proved it; one that arrives later could not
        points = self._points(there, seconds - times.last_s)
        return Sweep(points, stamp_s, layout.name, at, len(seconds) - len(points))

    def _points(self, there: dict[str, NDArray[Any]], times_s: NDArray[np.float64]) -> Points:
        x, y, z = there["x"], there["y"], there["z"]
        with np.errstate(invalid="ignore", over="ignore"):
            finite = np.isfinite(x + y + z)  # where all are, but for numbers that no LiDAR measures
        seen = finite & ((x != 0.0) | (y != 0.0) | (z != 0.0)) & np.isfinite(times_s)
        points = np.empty(int(np.count_nonzero(seen)), SWEEP)
        coordinates = xyz_of(points)
        for name, values in (("x", x), ("y", y), ("z", z)):
            points[name] = values[seen]
        rings = there["ring"][seen]
        if self.ring_order is None and len(points):
            self.ring_order = ring_order(coordinates, rings)
        points["ring"] = renumbered(rings.astype(np.uint16), self.ring_order, self._rings)
        if self._turned is not None:
            coordinates[:] = coordinates @ self._turned.T
        strength = there["intensity"][seen].astype(np.float32)
        points["intensity"] = np.clip(np.nan_to_num(strength, nan=0.0), 0.0, _HIGHEST_INTENSITY)
        points["time"] = times_s[seen]
        in_order = bool((np.diff(points["time"]) >= 0.0).all())
        return points if in_order else points[np.argsort(points["time"], kind="stable")]

    def _follow(self, stamp_s: float, arrival_s: float) -> None:
        """Raises CloudRefused for a repeated sweep."""
        before_s, period_s = self._newest_s, self._limits.period_s
        if (
            before_s is not None and before_s <= arrival_s + self._limits.future_s
        ):  # else this computer's clock was set back
            step_s = stamp_s - before_s
            if abs(step_s) < 0.01 * period_s:
                self.counters.add(DOUBLED)
                raise CloudRefused(f"the sweep of {stamp_s:.3f} s was received before, expected a newer one")
            if step_s < 0.0:
                self.counters.add(OUT_OF_ORDER)
                raise CloudRefused(f"the sweep is {-step_s:.3f} s older than the one before, expected a newer one")
            self.counters.add(LOST, max(0, round(step_s / period_s) - 1))
        self._newest_s = stamp_s


def _times(layout: Layout, field: NDArray[np.generic]) -> tuple[NDArray[np.float64], PointTimes]:
    """(n,) s and their ends. Points without a return count: the first and last column may have no returns."""
    values = field.astype(np.float64)
    finite = values[np.isfinite(values)]
    if not len(finite):
        raise CloudRefused(f"field {layout.time} has no finite time")
    first, last = float(finite.min()), float(finite.max())
    check_unit(layout, last)
    return values * layout.unit_s, PointTimes(first * layout.unit_s, last * layout.unit_s, layout.absolute)

"""Determines the reference point of the header's stamp of another driver's cloud, and the newest point's time.

Vendors stamp a sweep at its first point, at its last, or at a trigger in between; the contract's stamp is the newest
point's. A wrong reference removes the motion of a whole sweep from its points, or adds it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from robot_stack.drivers.point_cloud.cloud import CloudRefused


class StampAt(Enum):
    AUTO = "auto"
    FIRST = "first"
    LAST = "last"
    TRIGGER = "trigger"


@dataclass(frozen=True, slots=True)
class PointTimes:
    """The first and the newest point's time, s: absolute by the sensor's clock, else relative to the stamp."""

    first_s: float
    last_s: float
    absolute: bool

    @property
    def span_s(self) -> float:
        return self.last_s - self.first_s


@dataclass(frozen=True, slots=True)
class Limits:
    """period_s: of the sensor. tolerance_s: for clocks and first columns without a return.

    future_s: largest time of a newest point after its arrival; oldest_s: before it.
    """

    period_s: float
    tolerance_s: float
    future_s: float
    oldest_s: float


_SHORTEST, _LONGEST = 0.05, 1.5  # of a period: a unit taken for another is off by a thousand


def check_span(times: PointTimes, limits: Limits) -> None:
    """Raises CloudRefused if the points cannot be those of one sweep."""
    if not _SHORTEST * limits.period_s <= times.span_s <= _LONGEST * limits.period_s:
        raise CloudRefused(f"the points' times span {times.span_s:.6g} s, expected about {limits.period_s} s")


def stamp_at(times: PointTimes, stamp_s: float, arrival_s: float, configured: StampAt, limits: Limits) -> StampAt:
    """FIRST, LAST or TRIGGER: the configured one, unless the points contradict it, else the one they show.

    Raises CloudRefused for a contradiction, or if it cannot be determined.
    """
    found = (
        _absolute(times, stamp_s, configured, limits) if times.absolute else _offset(times, stamp_s, arrival_s, limits)
    )
    if configured is StampAt.AUTO:
        return found
    # Offsets from the first point with a stamp of the last: detected only by the configuration, or by a cloud that
    # would otherwise come from the future.
    counted_from_first = not times.absolute and found is StampAt.FIRST and configured is StampAt.LAST
    if found is configured or counted_from_first:
        return configured
    seen = f"from {times.first_s:+.6f} to {times.last_s:+.6f} s of it" if not times.absolute else "by the same clock"
    raise CloudRefused(f"the stamp is at the {found.value} point ({seen}), expected at the {configured.value}")


def newest_s(times: PointTimes, stamp_s: float, at: StampAt) -> float:
    """The newest point's time by the clock of the header's stamp."""
    if at is StampAt.LAST:
        return stamp_s if times.absolute or times.first_s >= 0.0 else stamp_s + times.last_s
    if at is StampAt.FIRST:
        return stamp_s + (times.span_s if times.absolute else times.last_s)
    return times.last_s if times.absolute else stamp_s + times.last_s


def check_arrival(newest: float, arrival_s: float, limits: Limits) -> None:
    """Raises CloudRefused for points from the future or too old."""
    age_s = arrival_s - newest
    if age_s < -limits.future_s:
        raise CloudRefused(
            f"the newest point lies {-age_s:.3f} s in the future: expected a stamp by this computer's clock"
        )
    if age_s > limits.oldest_s:
        raise CloudRefused(f"the newest point is {age_s:.3f} s old, expected at most {limits.oldest_s} s")


def _absolute(times: PointTimes, stamp_s: float, configured: StampAt, limits: Limits) -> StampAt:
    if abs(stamp_s - times.first_s) <= limits.tolerance_s:
        return StampAt.FIRST
    if abs(stamp_s - times.last_s) <= limits.tolerance_s:
        return StampAt.LAST
    if times.first_s < stamp_s < times.last_s:
        return StampAt.TRIGGER
    near = times.first_s - limits.period_s < stamp_s < times.last_s + limits.period_s
    if configured in (StampAt.FIRST, StampAt.LAST) and not near:
        return configured  # another clock: the points give only the sweep's length
    before = stamp_s < times.first_s
    apart_s = times.first_s - stamp_s if before else stamp_s - times.last_s
    where = "before the first" if before else "after the newest"
    raise CloudRefused(f"the stamp lies {apart_s:.3f} s {where} point, expected one clock, or stamp_at first or last")


def _offset(times: PointTimes, stamp_s: float, arrival_s: float, limits: Limits) -> StampAt:
    if times.last_s <= limits.tolerance_s:
        return StampAt.LAST
    if times.first_s < -limits.tolerance_s:
        return StampAt.TRIGGER
    if times.first_s > _LONGEST * limits.period_s:
        raise CloudRefused(
            f"the first point comes {times.first_s:.3f} s after the stamp, expected within a sweep of it"
        )
    # Counted from the first point: if the stamp were the first one's too, the newest would not have been measured yet.
    return StampAt.LAST if stamp_s + times.last_s > arrival_s + limits.future_s else StampAt.FIRST

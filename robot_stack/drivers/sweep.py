"""What a driver of a LiDAR makes of its packets."""

from __future__ import annotations

from dataclasses import dataclass

from robot_stack.core.point_cloud import Points


@dataclass(frozen=True, slots=True)
class Sweep:
    """points: ``SWEEP``, in the order of time. stamp_s: the newest point's time."""

    points: Points
    stamp_s: float

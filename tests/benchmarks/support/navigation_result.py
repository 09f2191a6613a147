"""How one course of the benchmark ``navigation`` went."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class CourseResult:
    """Result of one course. trace: (x, y, yaw, speed) each tick. step_ms, plan_ms: CPU time of each tick, route."""

    reached: bool
    time_s: float
    clearance_m: float
    person_m: float
    collisions: int
    text: str
    step_ms: list[float] = field(default_factory=list)
    plan_ms: list[float] = field(default_factory=list)
    trace: list[tuple[float, float, float, float]] = field(default_factory=list)
    walked: list[list[tuple[float, float]]] = field(default_factory=list)

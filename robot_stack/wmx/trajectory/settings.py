"""Timeouts of an execution."""

from __future__ import annotations

from dataclasses import dataclass

from robot_stack.wmx.trajectory.plan import PlanLimits


@dataclass(frozen=True, slots=True)
class ExecutionSettings:
    """start_timeout_s: until a started motion shows. end_timeout_s: after the spline's time, until the engine is at its
    end. status_timeout_s: without a status. standstill_radps, standstill_s: joints stand if they are slower for this
    long. stop_timeout_s: in addition to the longest time of the spline's own stop; quick_stop_timeout_s: of the quick
    stop that is requested then.
    """

    joints: tuple[str, ...]
    plan: PlanLimits
    start_timeout_s: float
    end_timeout_s: float
    status_timeout_s: float
    standstill_radps: float
    standstill_s: float
    stop_timeout_s: float
    quick_stop_timeout_s: float

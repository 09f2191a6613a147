"""The log of a run, as columns over time, and its figures."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Pose2, Twist2, wrap_angle

Column = NDArray[np.float64]
Four = tuple[float, float, float, float]
# Slower is standing: a tenth of what odometry calls standing.
STANDSTILL_MPS = 0.001


@dataclass(frozen=True, slots=True)
class Moment:
    """The truth at one moment: simulated s, pose in map, twist in base_link, wheels and modules as they are."""

    time_s: float
    pose: Pose2
    twist: Twist2
    wheel_speeds_mps: Four
    module_angles_rad: Four


@dataclass(slots=True)
class RunLog:
    """Everything noted of a run. Times are simulated s since it began.

    commands: (time, speeds m/s, angles rad) of /swerve/wheel_commands. requested: the twist the controller tries to
    reach.
    plans: (time, (n, 2) points). states: (time, text) whenever the safety state changes. events: (time, text).
    """

    moments: list[Moment] = field(default_factory=list)
    commands: list[tuple[float, Four, Four]] = field(default_factory=list)
    requested: list[tuple[float, Twist2]] = field(default_factory=list)
    estimates: list[tuple[float, Pose2]] = field(default_factory=list)
    plans: list[tuple[float, Column]] = field(default_factory=list)
    states: list[tuple[float, str]] = field(default_factory=list)
    events: list[tuple[float, str]] = field(default_factory=list)

    def log_state(self, time_s: float, state: str) -> None:
        if not self.states or self.states[-1][1] != state:
            self.states.append((time_s, state))


def motion_figures(run_log: RunLog, goal: Pose2 | None) -> dict[str, Any]:
    """Figures of the motion. Raises ValueError if nothing was noted."""
    if not run_log.moments:
        raise ValueError("this run recorded no data")
    moments = run_log.moments
    last = moments[-1]
    figures: dict[str, Any] = {
        "duration_s": last.time_s - moments[0].time_s,
        "distance_m": _distance_m([moment.pose for moment in moments]),
        "top_speed_mps": max(moment.twist.speed() for moment in moments),
        "final_speed_mps": last.twist.speed(),
        "final_x_m": last.pose.x,
        "final_y_m": last.pose.y,
        "final_yaw_deg": math.degrees(last.pose.yaw),
        "wheel_speed_rms_error_mps": _command_error(run_log),
        "safety_states": ", ".join(dict.fromkeys(state for _, state in run_log.states)),
        "final_safety_state": run_log.states[-1][1] if run_log.states else "",
    }
    if goal is not None:
        figures["final_error_m"] = last.pose.distance_to(goal)
        figures["final_error_deg"] = math.degrees(abs(wrap_angle(last.pose.yaw - goal.yaw)))
    figures |= _estimate_figures(run_log)
    return figures | _stop_figures(run_log)


def _distance_m(poses: Sequence[Pose2]) -> float:
    return sum(a.distance_to(b) for a, b in itertools.pairwise(poses))


def _command_error(run_log: RunLog) -> float:
    """Root mean square of wheel speed against the command in force, over all wheels, m/s; NaN without commands."""
    if not run_log.commands:
        return math.nan
    times = np.array([moment.time_s for moment in run_log.moments])
    begun = times >= run_log.commands[0][0]
    actual = np.array([moment.wheel_speeds_mps for moment in run_log.moments])[begun]
    at = np.searchsorted([time for time, _, _ in run_log.commands], times[begun], side="right") - 1
    commanded = np.array([speeds for _, speeds, _ in run_log.commands])[at]
    return float(np.sqrt(np.mean((actual - commanded) ** 2))) if len(actual) else math.nan


def _estimate_figures(run_log: RunLog) -> dict[str, float]:
    """Errors of the robot's own estimate, m."""
    if not run_log.estimates:
        return {}
    times = np.array([moment.time_s for moment in run_log.moments])
    errors = []
    for time_s, estimate in run_log.estimates:
        index = min(int(np.searchsorted(times, time_s)), len(times) - 1)
        errors.append(estimate.distance_to(run_log.moments[index].pose))
    return {"estimate_error_max_m": max(errors), "estimate_error_final_m": errors[-1]}


def _stop_figures(run_log: RunLog) -> dict[str, float]:
    """Way and time from the first event until standstill."""
    if not run_log.events:
        return {}
    from_s = run_log.events[0][0]
    after = [moment for moment in run_log.moments if moment.time_s >= from_s]
    standing = next((i for i, moment in enumerate(after) if moment.twist.speed() < STANDSTILL_MPS), None)
    if standing is None:
        return {"stop_distance_m": math.inf, "stop_time_s": math.inf}
    way = _distance_m([moment.pose for moment in after[: standing + 1]])
    return {"stop_distance_m": way, "stop_time_s": after[standing].time_s - from_s}

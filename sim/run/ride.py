"""Evaluation of a ride from samples of ground truth, plans and safety: pure, so that figures can be tested by hand."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.contract.states import DockingState, MissionState
from robot_stack.core.geometry import Pose2, wrap_angle
from robot_stack.core.rides import why_standing

# A plan that takes over on the move begins where the robot will be: until it is there, the old one counts as well.
_HANDOVER_S = 0.5

Line = NDArray[np.float64]
"""(n, 2) points x, y in m, map frame."""


@dataclass(frozen=True, slots=True)
class Sample:
    """The robot at one moment: s since the ride began, true pose in map, true speed over ground in m/s."""

    time_s: float
    pose: Pose2
    speed_mps: float


@dataclass(frozen=True, slots=True)
class Step:
    """A change of the mission: time in s, state, current waypoint, reason (may be empty)."""

    time_s: float
    state: str
    waypoint: str
    reason: str = ""


@dataclass(slots=True)
class Ride:
    """Everything noted of a ride. ``plans``: time of each plan in s and its points; empty plans cancel.

    estimates: the time a pose is of, s, and the estimate in map. touched: what robot or wheelchair touched.
    wheelchair: time in s and true pose in map of its dock frame. docking: time in s and state, where it changed.
    steps: of the mission. limits: time in s, the speed allowed by the safety monitor in m/s, and its reason.
    """

    samples: list[Sample] = field(default_factory=list)
    estimates: list[tuple[float, Pose2]] = field(default_factory=list)
    plans: list[tuple[float, Line]] = field(default_factory=list)
    wheelchair: list[tuple[float, Pose2]] = field(default_factory=list)
    docking: list[tuple[float, str]] = field(default_factory=list)
    touched: tuple[str, ...] = ()
    steps: list[Step] = field(default_factory=list)
    limits: list[tuple[float, float, str]] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Stop:
    """A stop of the robot: begin, duration, place in map, and the reported reason, if any."""

    time_s: float
    duration_s: float
    pose: Pose2
    why: str


@dataclass(frozen=True, slots=True)
class Figures:
    """The ride in numbers. Errors compare ground truth with the requested: the plan that was in force, and the goal."""

    distance_m: float
    time_s: float
    top_speed_mps: float
    final_error_m: float
    final_error_deg: float
    tracking_rms_m: float
    tracking_max_m: float
    estimate_rms_m: float
    estimate_p95_m: float
    estimate_p95_deg: float


def figures(ride: Ride, goal: Pose2) -> Figures:
    """The ride's figures. Raises ValueError for a ride without samples."""
    if not ride.samples:
        raise ValueError("this ride recorded no data")
    last = ride.samples[-1]
    errors_m = tracking_errors_m(ride)[:, 1]
    errors = estimate_errors(ride)
    known = len(errors) > 0
    return Figures(
        distance_m=distance_m(ride.samples),
        time_s=last.time_s - ride.samples[0].time_s,
        top_speed_mps=max(sample.speed_mps for sample in ride.samples),
        final_error_m=math.hypot(last.pose.x - goal.x, last.pose.y - goal.y),
        final_error_deg=math.degrees(abs(wrap_angle(last.pose.yaw - goal.yaw))),
        tracking_rms_m=float(np.sqrt(np.mean(errors_m**2))) if errors_m.size else math.nan,
        tracking_max_m=float(errors_m.max()) if errors_m.size else math.nan,
        estimate_rms_m=float(np.sqrt(np.mean(errors[:, 1] ** 2))) if known else math.nan,
        estimate_p95_m=float(np.percentile(errors[:, 1], 95.0)) if known else math.nan,
        estimate_p95_deg=float(np.degrees(np.percentile(errors[:, 2], 95.0))) if known else math.nan,
    )


@dataclass(frozen=True, slots=True)
class Carriage:
    """Evaluation of the wheelchair. Errors by ground truth; NaN without a docking.

    docked_mm, docked_deg: base_link beside the dock pose at the state DOCKED, before the latch drew it in.
    carried_m: way of the wheelchair. beside_m, beside_deg: where it stands at the end, from where it should.
    """

    docked_mm: float
    docked_deg: float
    carried_m: float
    beside_m: float
    beside_deg: float


def carriage(ride: Ride, dock_pose: Pose2, destination: Pose2 | None) -> Carriage | None:
    """The evaluation of the wheelchair; None if this world has none.

    dock_pose: base_link in the dock frame. destination: base_link in map where the wheelchair is put down.
    """
    if not ride.wheelchair:
        return None
    chairs = [pose for _, pose in ride.wheelchair]
    docked_s = next((time_s for time_s, state in ride.docking if state == DockingState.DOCKED), math.nan)
    docked = beside = Pose2(math.nan, math.nan, math.nan)
    if math.isfinite(docked_s):
        robot = min(ride.samples, key=lambda sample: abs(sample.time_s - docked_s)).pose
        chair = min(ride.wheelchair, key=lambda item: abs(item[0] - docked_s))[1]
        docked = robot.relative_to(chair.compose(dock_pose))
    if destination is not None:
        beside = chairs[-1].relative_to(destination.compose(dock_pose.inverse()))
    return Carriage(
        docked_mm=1e3 * math.hypot(docked.x, docked.y),
        docked_deg=math.degrees(abs(docked.yaw)),
        carried_m=sum(a.distance_to(b) for a, b in itertools.pairwise(chairs)),
        beside_m=math.hypot(beside.x, beside.y),
        beside_deg=math.degrees(abs(beside.yaw)),
    )


def distance_m(samples: Sequence[Sample]) -> float:
    """Length of the way between the samples."""
    return sum(math.hypot(b.pose.x - a.pose.x, b.pose.y - a.pose.y) for a, b in itertools.pairwise(samples))


def stops(ride: Ride, standing_mps: float, least_s: float) -> list[Stop]:
    """Where the robot stood for ``least_s`` or more, in order; slower than ``standing_mps`` is standing."""
    found = []
    for standing, group in itertools.groupby(ride.samples, lambda sample: sample.speed_mps < standing_mps):
        samples = list(group)
        first, duration_s = samples[0], samples[-1].time_s - samples[0].time_s
        if standing and duration_s >= least_s:
            found.append(
                Stop(first.time_s, duration_s, first.pose, _why(ride, first.time_s, first.time_s + duration_s))
            )
    return found


def arrivals(steps: Sequence[Step]) -> list[tuple[str, float]]:
    """Each waypoint and when the mission went on from it, s, in order."""
    done = [(a.waypoint, b.time_s) for a, b in itertools.pairwise(steps) if a.waypoint and a.waypoint != b.waypoint]
    last = next((step for step in steps if step.state == MissionState.COMPLETED), None)
    return done if last is None or (done and done[-1][1] == last.time_s) else [*done, (last.waypoint, last.time_s)]


def _why(ride: Ride, begin_s: float, end_s: float) -> str:
    """The most severe cause while it stood: a stop of the safety monitor, docking, or the mission's reason."""
    limits = [reason for _, speed_mps, reason in _during(ride.limits, begin_s, end_s) if speed_mps <= 0.0]
    docking = [state for _, state in _during(ride.docking, begin_s, end_s)]
    steps = [step for _, step in _during([(step.time_s, step) for step in ride.steps], begin_s, end_s)]
    return why_standing(limits, docking, [(step.state, step.waypoint, step.reason) for step in steps])


def _during(items: Sequence[Any], begin_s: float, end_s: float) -> list[Any]:
    """Of items that begin with their time and hold until the next one: those in force between two times."""
    ends = [*(item[0] for item in items[1:]), math.inf]
    return [item for item, until_s in zip(items, ends, strict=False) if item[0] <= end_s and until_s > begin_s]


def estimate_errors(ride: Ride) -> NDArray[np.float64]:
    """(n, 3): time in s, and error of the estimate at that time, m and rad."""
    times = np.array([sample.time_s for sample in ride.samples])
    errors = []
    for time_s, pose in ride.estimates:
        after = int(np.searchsorted(times, time_s))
        if not 0 < after < len(times):
            continue
        before, behind = ride.samples[after - 1], ride.samples[after]
        share = (time_s - before.time_s) / max(behind.time_s - before.time_s, 1e-9)
        step = behind.pose.relative_to(before.pose)
        truth = before.pose.compose(Pose2(share * step.x, share * step.y, share * step.yaw))
        errors.append((time_s, truth.distance_to(pose), abs(wrap_angle(pose.yaw - truth.yaw))))
    return np.asarray(errors, dtype=np.float64).reshape(-1, 3)


def tracking_errors_m(ride: Ride) -> NDArray[np.float64]:
    """(n, 2): time in s, and distance of the true position from the plan in force in m, of each sample with a plan."""
    errors = []
    before: Line | None = None
    for index, (from_s, line) in enumerate(ride.plans):
        until_s = ride.plans[index + 1][0] if index + 1 < len(ride.plans) else math.inf
        if len(line) < 2:
            before = None
            continue
        for sample in ride.samples:
            if from_s <= sample.time_s < until_s:
                point = np.array([sample.pose.x, sample.pose.y])
                lines = [line] if before is None or sample.time_s > from_s + _HANDOVER_S else [line, before]
                errors.append((sample.time_s, min(distance_to_line_m(point, each) for each in lines)))
        before = line
    return np.asarray(errors, dtype=np.float64).reshape(-1, 2)


def distance_to_line_m(point: NDArray[np.float64], line: Line) -> float:
    """Distance of a point (2,) from a polyline of two points or more, m."""
    begins, steps = line[:-1], np.diff(line, axis=0)
    lengths2 = np.einsum("ij,ij->i", steps, steps)
    along = np.einsum("ij,ij->i", point - begins, steps) / np.where(lengths2 > 0.0, lengths2, 1.0)
    nearest = begins + np.clip(along, 0.0, 1.0)[:, None] * steps
    return float(np.sqrt(((nearest - point) ** 2).sum(axis=1).min()))

"""Trajectories of the arm: how well the spline is tracked, how soon a goal begins, how soon a canceled one stands."""

from __future__ import annotations

import os
import random
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from tests.benchmarks.support.framework import Aim, BenchError, Result, percentile
from tests.benchmarks.support.own_engine import PRIORITY, go_first
from tests.benchmarks.support.trajectory_rig import JOINTS, ArmRig, Record, arm_engine, arm_rig

FloatArray = NDArray[np.float64]

AIMS = {
    "tracking_error_rad_max": Aim("<", 0.005),
    "start_latency_ms_p99": Aim("<", 20.0),
    "cancel_to_standstill_ms_max": Aim("<", 300.0),
    "runs": Aim(">=", 200),
}
_ENGINES = {
    "virtual": ("robot_stack.wmx.engine_server",),
    "arm": ("robot_stack.ros.main", "sim_manipulator"),
}
_DRIVES = {
    "virtual": "virtual drives, first-order lag of 5 ms, no feed-forward",
    "arm": "six-axis arm in physics (MuJoCo), cascaded servo loops, gravity and friction",
}
_SERVER = "robot_stack.ros.main", "follow_joint_trajectory_server"
_PLAIN = ("tests.benchmarks.nodes.plain_trajectory_server",)
_COMPARED = ("tracking_error_rad_max", "start_latency_ms_p99", "start_latency_ms_p50", "cancel_to_standstill_ms_max")
_STANDSTILL_RADPS = 0.01
_MOVED_RAD = 1e-7
_LONGEST_S = 1.0


@dataclass(slots=True)
class _Measured:
    tracking_rad: list[float] = field(default_factory=list)
    squares: list[float] = field(default_factory=list)
    command_rad: list[float] = field(default_factory=list)
    start_ms: list[float] = field(default_factory=list)
    standstill_ms: list[float] = field(default_factory=list)
    off_path_rad: list[float] = field(default_factory=list)
    canceled_ms: list[float] = field(default_factory=list)
    feedbacks: list[float] = field(default_factory=list)
    per_joint_rad: FloatArray = field(default_factory=lambda: np.zeros(JOINTS))


def run(
    runs: int = 200,
    cancels: int = 20,
    plain_runs: int = 20,
    world: str = "virtual",
    max_speed_radps: float = 0.9,
    reach_rad: float = 0.5,
    seed: int = 1,
) -> Result:
    """An engine and the trajectory server as processes in a domain of their own; goals come from this process.

    cancels: of further trajectories. plain_runs: runs of a straightforward rclpy server on the same engine, for
    comparison, with a quarter as many cancels; 0 omits it. world: virtual or arm, the plant of the engine's axes.
    max_speed_radps: the fastest joint of a trajectory peaks between a fifth of it and it. reach_rad: largest
    joint position.
    """
    if world not in _ENGINES:
        raise BenchError(f"world must be one of {', '.join(_ENGINES)}")
    domain = 1 + os.getpid() % 19  # tests have those from 20 on
    realtime = go_first(0, PRIORITY)
    course = _Course(np.random.default_rng(seed), random.Random(seed), max_speed_radps, reach_rad)
    plain = None
    with arm_engine(domain, _ENGINES[world]) as engine:
        with arm_rig(domain, engine, _SERVER) as rig:
            ours = _measure(rig, course, runs, cancels)
        if plain_runs:
            with arm_rig(domain, engine, _PLAIN) as rig:
                plain = _measure(rig, course, plain_runs, plain_runs // 4)
    figures = _figures(ours, runs)
    if plain is not None:
        compared = _figures(plain, plain_runs)
        figures |= {f"plain_{name}": compared[name] for name in _COMPARED if name in compared}
    return Result(figures, {**_conditions(world, course, seed), "realtime_priority": realtime})


@dataclass(slots=True)
class _Course:
    """Generator of trajectories. peaks: fastest joint of each trajectory so far, rad/s."""

    generator: np.random.Generator
    moment: random.Random
    max_speed_radps: float
    reach_rad: float
    peaks: list[float] = field(default_factory=list)

    def next(self, here: FloatArray) -> tuple[FloatArray, FloatArray, Any]:
        times_s, rows = _trajectory(self.generator, here, self.reach_rad, self.max_speed_radps)
        spline = CubicSpline(times_s, rows, bc_type="clamped")
        self.peaks.append(_peak(spline))
        return times_s, rows, spline


def _measure(rig: ArmRig, course: _Course, runs: int, cancels: int) -> _Measured:
    measured = _Measured()
    for number in range(runs + cancels):
        times_s, rows, spline = course.next(rig.position())
        if number < runs:
            with rig.recording() as recorder:
                sent_ns, code, text = rig.follow(times_s, rows)
            if code != 0:
                raise BenchError(f"trajectory {number}: error {code} {text}")
            _follow(measured, spline, recorder.record, sent_ns)
        else:
            after_s = course.moment.uniform(0.3, 0.7) * float(times_s[-1])
            with rig.recording() as recorder:
                canceled_ns, result_ns = rig.cancel(times_s, rows, after_s)
            _cancel(measured, spline, recorder.record, canceled_ns, result_ns)
        time.sleep(course.moment.uniform(0.0, 0.02))  # so that goals arrive at a random phase of the server's period
    measured.feedbacks = rig.feedback_errors
    return measured


def _trajectory(
    random_: np.random.Generator, here: FloatArray, reach_rad: float, max_speed_radps: float
) -> tuple[FloatArray, FloatArray]:
    """Times (n,) s from 0 and rows (n, joints) rad from ``here``; 4 to 10 points, stretched to its speed."""
    n = int(random_.integers(4, 11))
    rows = np.vstack([here, random_.uniform(-reach_rad, reach_rad, (n - 1, JOINTS))])
    times_s = np.concatenate([[0.0], np.cumsum(random_.uniform(0.1, 0.3, n - 1))])
    speed = random_.uniform(0.2, 1.0) * max_speed_radps
    times_s *= _peak(CubicSpline(times_s, rows, bc_type="clamped")) / speed
    if times_s[-1] > _LONGEST_S:  # shorten the way, not the speed
        keep = max(2, int(np.searchsorted(times_s, _LONGEST_S)))
        times_s, rows = times_s[:keep], rows[:keep]
        stretch = _peak(CubicSpline(times_s, rows, bc_type="clamped")) / speed
        times_s = times_s * max(1.0, stretch)
    return times_s, rows


def _peak(spline: Any) -> float:
    return float(np.abs(spline(np.linspace(0.0, spline.x[-1], 400), 1)).max())


def _begin_s(spline: Any, record: Record) -> float:
    """Engine time at which the spline began: the shift of its best fit to the commands (two Newton steps)."""
    first = int(np.argmax(np.abs(record.command - record.command[0]).max(axis=1) > _MOVED_RAD))
    begin_s = float(record.engine_s[max(0, first - 1)])
    for _ in range(3):
        time_s = record.engine_s - begin_s
        on = (time_s > 0.0) & (time_s < spline.x[-1])
        slope = spline(time_s[on], 1)
        ahead = record.command[on] - spline(time_s[on])
        begin_s -= float((ahead * slope).sum() / (slope * slope).sum())
    return begin_s


def _follow(measured: _Measured, spline: Any, record: Record, sent_ns: int) -> None:
    begin_s = _begin_s(spline, record)
    time_s = np.clip(record.engine_s - begin_s, 0.0, spline.x[-1])
    error = np.abs(record.position - spline(time_s))
    during = record.engine_s - begin_s >= 0.0
    measured.tracking_rad.append(float(error[during].max()))
    measured.squares.append(float((error[during] ** 2).mean()))
    measured.command_rad.append(float(np.abs(record.command - spline(time_s)).max()))
    measured.per_joint_rad = np.maximum(measured.per_joint_rad, error[during].max(axis=0))
    moving = int(np.argmax(during))
    began_ns = int(record.stamp_ns[moving]) - 1e9 * (float(record.engine_s[moving]) - begin_s)
    measured.start_ms.append((began_ns - sent_ns) * 1e-6)


def _cancel(measured: _Measured, spline: Any, record: Record, canceled_ns: int, result_ns: int) -> None:
    moving = (np.abs(record.velocity) > _STANDSTILL_RADPS).any(axis=1) | (record.command_velocity != 0.0).any(axis=1)
    last = int(np.flatnonzero(moving)[-1])
    measured.standstill_ms.append((int(record.stamp_ns[min(last + 1, len(moving) - 1)]) - canceled_ns) * 1e-6)
    measured.canceled_ms.append((result_ns - canceled_ns) * 1e-6)
    measured.off_path_rad.append(_off_path(spline, record.command[-1]))


def _off_path(spline: Any, place: FloatArray) -> float:
    """Distance of a position from the path, rad of the joint with the largest error."""
    low, high = 0.0, float(spline.x[-1])
    distances = np.zeros(1)
    for _ in range(3):
        times_s = np.linspace(low, high, 2000)
        distances = np.abs(spline(times_s) - place).max(axis=1)
        nearest = int(np.argmin(distances))
        low, high = float(times_s[max(0, nearest - 1)]), float(times_s[min(len(times_s) - 1, nearest + 1)])
    return float(distances.min())


def _figures(measured: _Measured, runs: int) -> dict[str, float]:
    figures = {
        "tracking_error_rad_max": max(measured.tracking_rad),
        "tracking_error_rad_p50_of_maxima": percentile(measured.tracking_rad, 0.5),
        "tracking_error_rad_rms": float(np.sqrt(np.mean(measured.squares))),
        "command_error_rad_max": max(measured.command_rad),
        "start_latency_ms_p99": percentile(measured.start_ms, 0.99),
        "start_latency_ms_p50": percentile(measured.start_ms, 0.5),
        "start_latency_ms_max": max(measured.start_ms),
        "start_latency_ms_of_first_goal": measured.start_ms[0],
        "feedback_error_rad_max": max(measured.feedbacks, default=0.0),
        "runs": runs,
        "cancels": len(measured.standstill_ms),
    }
    if measured.standstill_ms:
        figures |= {
            "cancel_to_standstill_ms_max": max(measured.standstill_ms),
            "cancel_to_standstill_ms_p50": percentile(measured.standstill_ms, 0.5),
            "cancel_to_result_ms_max": max(measured.canceled_ms),
            "stop_off_path_rad_max": max(measured.off_path_rad),
        }
    figures |= {f"tracking_error_joint{joint + 1}_rad_max": float(measured.per_joint_rad[joint]) for joint in range(6)}
    return figures


def _conditions(world: str, course: _Course, seed: int) -> dict[str, Any]:
    return {
        "drives": _DRIVES[world],
        "engine": "simulated, 1 ms cycle, real time",
        "tracking_error": "measured position against scipy's clamped cubic spline through the goal's points, in the "
        "engine's time, all six axes, every cycle that was seen, from the start to the result",
        "command_error": "the engine's command against the same spline",
        "start_latency": "from the client's send_goal to the first commanded motion, on the monotonic clock",
        "cancel_to_standstill": "from the client's cancel_goal until command and joints stand "
        f"(< {_STANDSTILL_RADPS} rad/s)",
        "feedback_error": "largest error of desired against actual in the action's feedback",
        "trajectory_peak_speed_radps_max": round(max(course.peaks), 3),
        "trajectory_peak_speed_radps_mean": round(float(np.mean(course.peaks)), 3),
        "reach_rad": course.reach_rad,
        "plain": "rclpy action server in a multi-threaded executor, looks every 10 ms, no checks and no feedback",
        "seed": seed,
    }

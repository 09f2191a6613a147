"""Pictures of a run: the way on the map, speeds, wheel commands against wheels, safety states."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from robot_stack.contract.frames import MODULES
from sim.pictures.ride_plots import DPI, draw_map
from sim.run.ride import Ride, Sample
from sim.run.run_log import RunLog
from sim.worldfile import WorldFile


def draw_all(folder: Path, world: WorldFile, run_log: RunLog) -> list[Path]:
    """All pictures of a run, as PNG files in ``folder``. Returns their paths."""
    draw_map(folder / "path.png", world, _ride(run_log), [])
    _draw_speed(folder / "speed.png", run_log)
    _draw_wheels(folder / "wheels.png", run_log)
    _draw_states(folder / "safety.png", run_log)
    return [folder / name for name in ("path.png", "speed.png", "wheels.png", "safety.png")]


def _ride(run_log: RunLog) -> Ride:
    samples = [Sample(moment.time_s, moment.pose, moment.twist.speed()) for moment in run_log.moments]
    return Ride(samples, estimates=run_log.estimates, plans=run_log.plans)


def _draw_speed(path: Path, run_log: RunLog) -> None:
    figure = Figure(figsize=(10.0, 7.0), layout="constrained")
    rows = figure.subplots(3, 1, sharex=True)
    times = [moment.time_s for moment in run_log.moments]
    requested_s = [time for time, _ in run_log.requested]
    for axes, name, unit in zip(rows, ("vx", "vy", "omega"), ("m/s", "m/s", "rad/s"), strict=True):
        axes.plot(times, [getattr(moment.twist, name) for moment in run_log.moments], label="true")
        axes.plot(requested_s, [getattr(twist, name) for _, twist in run_log.requested], "--", label="requested")
        axes.set(ylabel=f"{name} / {unit}")
        _mark_events(axes, run_log)
    rows[0].legend(loc="upper right")
    rows[-1].set(xlabel="time / s")
    figure.savefig(path, dpi=DPI)


def _draw_wheels(path: Path, run_log: RunLog) -> None:
    figure = Figure(figsize=(12.0, 9.0), layout="constrained")
    rows = figure.subplots(4, 2, sharex=True)
    times = [moment.time_s for moment in run_log.moments]
    commanded_s = [time for time, _, _ in run_log.commands]
    speeds = np.array([moment.wheel_speeds_mps for moment in run_log.moments])
    angles = np.array([moment.module_angles_rad for moment in run_log.moments])
    for i, name in enumerate(MODULES):
        left, right = rows[i]
        left.plot(times, speeds[:, i], label="wheel")
        left.step(commanded_s, [item[i] for _, item, _ in run_log.commands], "--", where="post", label="command")
        left.set(ylabel=f"{name} / m/s")
        right.plot(times, np.degrees(_wrapped(angles[:, i])))
        turned = _wrapped(np.array([item[i] for _, _, item in run_log.commands]))
        right.step(commanded_s, np.degrees(turned), "--", where="post")
        right.set(ylabel=f"{name} / deg")
    rows[0][0].legend(loc="upper right")
    for axes in rows[-1]:
        axes.set(xlabel="time / s")
    figure.savefig(path, dpi=DPI)


def _draw_states(path: Path, run_log: RunLog) -> None:
    figure = Figure(figsize=(10.0, 3.0), layout="constrained")
    axes = figure.subplots()
    end_s = run_log.moments[-1].time_s
    names = list(dict.fromkeys(state for _, state in run_log.states))
    for index, (from_s, state) in enumerate(run_log.states):
        until_s = run_log.states[index + 1][0] if index + 1 < len(run_log.states) else end_s
        axes.barh(names.index(state), until_s - from_s, left=from_s, height=0.6)
    axes.set_yticks(range(len(names)), names)
    axes.set(xlabel="time / s", xlim=(0.0, max(end_s, 1e-3)))
    _mark_events(axes, run_log)
    for time_s, text in run_log.events:
        axes.annotate(text, (time_s, 0.0), rotation=90, fontsize=7, va="bottom", ha="right")
    figure.savefig(path, dpi=DPI)


def _mark_events(axes: Any, run_log: RunLog) -> None:
    for time_s, _ in run_log.events:
        axes.axvline(time_s, color="#b3261e", linewidth=0.8)
    axes.grid(alpha=0.3)


def _wrapped(angles_rad: Any) -> Any:
    return (angles_rad + np.pi) % (2.0 * np.pi) - np.pi

"""Pictures of a ride: the way on the map, and speed and deviation over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from robot_stack.core.geometry import Pose2
from sim.run.ride import Ride, Stop, estimate_errors, tracking_errors_m
from sim.worldfile import WorldFile

_OBSTACLE, _PLANNED, _DRIVEN, _GOAL = "#8a8f98", "#e08a00", "#1f5fbf", "#b3261e"
DPI = 130


def draw_map(
    path: Path, world: WorldFile, ride: Ride, waypoints: Sequence[tuple[str, Pose2]], stood: Sequence[Stop] = ()
) -> None:
    """The world from above with the plans, the true way, the waypoints and the numbered stops, as a PNG."""
    figure = Figure(figsize=(10.0, 7.0), layout="constrained")
    axes = figure.subplots()
    draw_world(axes, world)
    lines = [line for _, line in ride.plans if len(line)]
    for index, line in enumerate(lines):
        label = "planned" if index == 0 else None
        axes.plot(line[:, 0], line[:, 1], color=_PLANNED, linewidth=3.0, alpha=0.6, label=label)
    way = np.array([(sample.pose.x, sample.pose.y) for sample in ride.samples])
    axes.plot(way[:, 0], way[:, 1], color=_DRIVEN, linewidth=1.2, label="driven (ground truth)")
    for name, pose in waypoints:
        u, v = math.cos(pose.yaw), math.sin(pose.yaw)
        axes.quiver(pose.x, pose.y, u, v, angles="xy", scale=28.0, width=0.004, color=_GOAL, zorder=5)
        axes.annotate(name, (pose.x, pose.y), textcoords="offset points", xytext=(4, -12), fontsize=8, color=_GOAL)
    for number, stop in enumerate(stood, start=1):
        axes.plot(stop.pose.x, stop.pose.y, "o", color=_DRIVEN, markersize=11.0, zorder=6)
        axes.annotate(
            str(number), (stop.pose.x, stop.pose.y), color="white", fontsize=7, ha="center", va="center", zorder=7
        )
    margin_m = 3.0
    axes.set_xlim(way[:, 0].min() - margin_m, way[:, 0].max() + margin_m)
    axes.set_ylim(way[:, 1].min() - margin_m, way[:, 1].max() + margin_m)
    axes.set(xlabel="x / m", ylabel="y / m", aspect="equal")
    axes.legend(loc="upper left")
    figure.savefig(path, dpi=DPI)


def draw_course(path: Path, ride: Ride) -> None:
    """Speed, deviation from the plan and error of the estimated pose, over time, as a PNG."""
    figure = Figure(figsize=(10.0, 7.5), layout="constrained")
    upper, middle, lower = figure.subplots(3, 1, sharex=True)
    upper.plot([s.time_s for s in ride.samples], [s.speed_mps for s in ride.samples], color=_DRIVEN)
    upper.set(ylabel="speed / m/s")
    errors = tracking_errors_m(ride)
    middle.plot(errors[:, 0], 1e3 * errors[:, 1], ".", markersize=2.0, color=_PLANNED)
    middle.set(ylabel="distance from the plan / mm")
    errors = estimate_errors(ride)
    lower.plot(errors[:, 0], 1e3 * errors[:, 1], ".", markersize=2.0, color=_DRIVEN)
    lower.set(xlabel="time / s", ylabel="error of the estimated pose / mm")
    for axes in (upper, middle, lower):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=DPI)


def draw_world(axes: Any, world: WorldFile) -> None:
    """The world's fixed things from above; low ones are pale."""
    for box in (*world.walls, *world.boxes, *world.kerbs):
        middle, alpha = Pose2(box.x_m, box.y_m, box.yaw_rad), 0.9 if box.height_m > 0.2 else 0.4
        draw_box(axes, middle, (box.length_m, box.width_m), color=_OBSTACLE, alpha=alpha)
    for cylinder in world.cylinders:
        axes.add_patch(Circle((cylinder.x_m, cylinder.y_m), cylinder.radius_m, color=_OBSTACLE))


def draw_box(axes: Any, middle: Pose2, size_m: tuple[float, float], **style: Any) -> None:
    """A turned rectangle. size_m: length, width."""
    corner = (middle.x - 0.5 * size_m[0], middle.y - 0.5 * size_m[1])
    axes.add_patch(Rectangle(corner, *size_m, angle=math.degrees(middle.yaw), rotation_point="center", **style))

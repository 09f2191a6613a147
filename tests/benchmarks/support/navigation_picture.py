"""Pictures of courses of the benchmarks ``navigation`` and ``crowd``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import load_robot
from sim.pictures.ride_plots import draw_box
from tests.benchmarks.support.navigation_course import Box, Course, body, course
from tests.benchmarks.support.navigation_result import CourseResult

_MOST = 6


def draw(driven: Sequence[tuple[int, bool, CourseResult]], path: Path) -> None:
    """Draws the courses of seeds with the worst results."""
    robot = load_robot()
    draw_courses(
        [
            (str(seed), course(seed, robot.footprint_with_chair if chair else robot.footprint), chair, result)
            for seed, chair, result in driven
        ],
        path,
    )


def draw_courses(driven: Sequence[tuple[str, Course, bool, CourseResult]], path: Path) -> None:
    """Draws the (name, course, with chair, result) that went worst, ordered by failure, then clearance."""
    worst = sorted(driven, key=lambda item: (item[3].reached, -item[3].collisions, item[3].clearance_m))[:_MOST]
    columns = 2 if len(worst) > 1 else 1
    rows = -(-len(worst) // columns)
    figure = Figure(figsize=(10 * columns, 5.2 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    robot = load_robot()
    for ax, (name, made, chair, result) in zip(axes.flat, worst, strict=False):
        footprint = robot.footprint_with_chair if chair else robot.footprint
        for boxes, colour in ((made.known, "0.3"), (made.unknown, "tab:orange")):
            for box in boxes:
                _draw(ax, box, color=colour)
        for walked in result.walked:
            ax.plot(*np.array(walked).T, ":", color="tab:red", lw=1)
        trace = np.array(result.trace)
        for x, y, yaw, _ in trace[::20]:
            _draw(ax, body(Pose2(x, y, yaw), footprint), fill=False, lw=0.4, color="tab:blue")
        points = ax.scatter(trace[:, 0], trace[:, 1], c=trace[:, 3], s=3, cmap="viridis", vmin=0.0, vmax=1.5, zorder=3)
        figure.colorbar(points, ax=ax, label="m/s", shrink=0.7)
        ax.plot(made.goal.x, made.goal.y, "r*")
        end = "reached" if result.reached else result.text
        ax.set_title(f"{name}: {end}, {result.time_s:.0f} s, clearance {result.clearance_m:.2f} m", fontsize=9)
        ax.set_aspect("equal")
        ax.set_xlim(0, 32)
        ax.set_ylim(0, 16)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=70)


def _draw(axes: Any, box: Box, **style: Any) -> None:
    draw_box(axes, Pose2(box.x, box.y, box.yaw), (2.0 * box.half_x, 2.0 * box.half_y), **style)

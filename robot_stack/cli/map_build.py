"""``robot-stack map build``: reads, builds, saves, draws, reports."""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from robot_stack.cli.errors import WRONG_USE, CommandError, writing
from robot_stack.cli.map_picture import draw_map
from robot_stack.cli.map_recording import read_ride
from robot_stack.core.config import config_dir, load
from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import load_robot
from robot_stack.core.site_map import FREE, OCCUPIED, Cells, Grid, SiteMap, save_map
from robot_stack.mapping.build import Built, build_map
from robot_stack.mapping.params import MappingParams
from robot_stack.mapping.report import distance_m, drift
from robot_stack.mapping.ride import Ride, RideError

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_MOST_LOOPS = 5
_SOURCE = "the recording of a ride"


def build_from_recording(
    recording: Path, name: str, output: Path | None, origin: tuple[float, float, float] | None, plot: bool
) -> None:
    """Raises CommandError, ConfigError."""
    folder, start = wanted(name, output, origin)
    params, robot = load(MappingParams, "mapping"), load_robot()
    with ProgressBar() as bar:
        ride, warnings = read_ride(recording, params.sweeps, robot, lambda done, total: bar("reading", done, total))
        try:
            built = build_map(ride, params, robot, start, bar)
        except RideError as error:
            raise CommandError(f"{recording}: {error}") from None
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    site = SiteMap(name, built.cells, built.grid, _about(recording, ride, built, start))
    with writing(folder):
        save_map(site, folder)
    if plot:
        ends = np.array([[built.poses[k, :2, 3] for k in (loop.earlier, loop.later)] for loop in built.loops])
        draw_map(site, folder / "map.png", built.poses[:, :2, 3], ends)
    print("\n".join(lines_of(site)))
    print(f"written: {folder}")


def wanted(name: str, output: Path | None, origin: tuple[float, float, float] | None) -> tuple[Path, Pose2 | None]:
    """(folder of the map, its origin). Raises CommandError for invalid arguments."""
    if not _NAME.fullmatch(name):
        raise CommandError(f"name {name!r}: letters, digits and _ . - only", WRONG_USE)
    if origin is not None and not np.isfinite(origin).all():
        raise CommandError(f"origin must be three finite numbers, is {origin}", WRONG_USE)
    folder = (output if output is not None else config_dir() / "maps") / name
    return folder, None if origin is None else Pose2(*origin)


def _about(recording: Path, ride: Ride, built: Built, start: Pose2 | None) -> dict[str, Any]:
    origin = start or Pose2(0.0, 0.0, 0.0)
    return {
        "frame": "map",
        "made_from": _SOURCE,
        "recording": recording.absolute().name,
        "recorded": time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(float(built.stamps_s[0]))),
        "begins_at": place_of(origin),
        "ride": {
            "length_m": round(distance_m(built.poses), 1),
            "duration_s": round(float(built.stamps_s[-1] - built.stamps_s[0]), 1),
            "sweeps": len(ride.sweeps),
        },
        **size_of(built.cells, built.grid),
        "points_left_out_because_they_moved": round(built.moved_share, 5),
        "drift": drift(built),
    }


def place_of(pose: Pose2) -> dict[str, float]:
    """A pose, for map.yaml."""
    return {"x_m": pose.x, "y_m": pose.y, "yaw_rad": pose.yaw}


def size_of(cells: Cells, grid: Grid) -> dict[str, Any]:
    """The sizes of a map, for map.yaml."""
    rows, columns = grid.occupancy.shape
    return {
        "cells": {"size_m": cells.size_m, "count": len(cells.count), "points": int(cells.count.sum())},
        "grid": {
            "resolution_m": grid.resolution_m,
            "width_m": round(columns * grid.resolution_m, 2),
            "height_m": round(rows * grid.resolution_m, 2),
            "free_m2": round(float((grid.occupancy == FREE).sum()) * grid.resolution_m**2, 1),
            "occupied_m2": round(float((grid.occupancy == OCCUPIED).sum()) * grid.resolution_m**2, 1),
        },
    }


def lines_of(site: SiteMap) -> list[str]:
    """A map in words."""
    about = site.about
    ride, grid, found = about.get("ride", {}), about.get("grid", {}), about.get("drift", {})
    lines = [
        f"map {site.name}: {len(site.cells.count)} cells of {site.cells.size_m:g} m, "
        f"grid {grid.get('width_m', '?')} x {grid.get('height_m', '?')} m at {site.grid.resolution_m:g} m, "
        f"{grid.get('free_m2', '?')} m2 free",
    ]
    if "plan" in about:
        return [*lines, *_lines_of_plan(about["plan"])]
    lines += [
        f"ride: {ride.get('length_m', '?')} m in {ride.get('duration_s', '?')} s, {ride.get('sweeps', '?')} sweeps, "
        f"recorded {about.get('recorded', '?')}",
        f"loops closed: {found.get('loops_closed', '?')}; largest error at a loop closure: "
        f"{found.get('wheel_odometry_worst_loop_m', '?')} m of wheel odometry, "
        f"{found.get('lidar_odometry_worst_loop_m', '?')} m of LiDAR odometry, "
        f"{found.get('map_worst_loop_m', '?')} m of the map",
        f"error at the end of the ride: wheel odometry {found.get('wheel_odometry_end_error_m', '?')} m, "
        f"LiDAR odometry {found.get('lidar_odometry_end_error_m', '?')} m",
    ]
    loops = sorted(found.get("loops", []), key=lambda loop: -float(loop["wheel_odometry_m"]))
    lines += [
        f"  loop between {loop['from_s']:g} s and {loop['to_s']:g} s of the ride: error of wheel odometry "
        f"{loop['wheel_odometry_m']:.3f} m, LiDAR odometry {loop['lidar_odometry_m']:.3f} m, "
        f"map {loop['map_m']:.3f} m"
        for loop in loops[:_MOST_LOOPS]
    ]
    if len(loops) > _MOST_LOOPS:
        lines.append(f"  and {len(loops) - _MOST_LOOPS} loops with smaller errors: see map.yaml")
    if found.get("loops_closed") == 0:
        lines.append("no loop was closed: the map contains the drift of the odometry, whose size is unknown")
        lines.append("drive again, cross the driven path and end at the start (docs/mapping.md)")
    return lines


def _lines_of_plan(plan: dict[str, Any]) -> list[str]:
    """The source of a map in words, and what such a map lacks."""
    return [
        f"floor plan: {plan['picture']} at {plan['resolution_m']:g} m a pixel, walls of {plan['wall_height_m']:g} m",
        "the map has only what the plan shows: no furniture, ramps, kerbs or steps, and no measured error; glass and "
        "closed doors of the plan are walls in it",
        "compare it with the site before the first ride (docs/sites.md)",
    ]


def problems_of(site: SiteMap) -> list[str]:
    """Defects that make a map with intact files unusable, and missing entries of its map.yaml."""
    problems = []
    if not len(site.cells.count):
        problems.append(f"{site.name}: contains no cell")
    if not (site.grid.occupancy == FREE).any():
        problems.append(f"{site.name}: no part of the grid is free")
    source = ("plan",) if "plan" in site.about else ("ride", "drift")
    missing = [key for key in ("frame", "made_from", "begins_at", *source) if key not in site.about]
    if missing:
        problems.append(f"{site.name}: map.yaml lacks {', '.join(missing)}")
    return problems


class ProgressBar:
    """A progress bar on a terminal; no output elsewhere."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import Progress

        self._bar = Progress(console=Console(stderr=True), disable=not sys.stderr.isatty())
        self._task: Any = None
        self._what = ""

    def __enter__(self) -> ProgressBar:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def __call__(self, what: str, done: int, total: int) -> None:
        if what != self._what:
            if self._task is not None:
                self._bar.update(self._task, completed=1, total=1)
            self._task, self._what = self._bar.add_task(what, total=total), what
        self._bar.update(self._task, completed=done, total=total)

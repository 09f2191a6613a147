"""``robot-stack map build``: reads, builds, saves, draws, reports."""

from __future__ import annotations

import math
import re
import sys
import time
from collections.abc import Sequence
from functools import partial
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
from robot_stack.localization.ndt.matcher import NdtMatcher
from robot_stack.localization.ndt.search import Region, search
from robot_stack.localization.params import LocalizationParams
from robot_stack.mapping.build import Built, build_map
from robot_stack.mapping.joining import Finder, Recognition
from robot_stack.mapping.params import Joining, MappingParams
from robot_stack.mapping.poses import Floats
from robot_stack.mapping.report import drift, lengths, rides_of
from robot_stack.mapping.ride import Ride, RideError

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_MOST_LOOPS = 5
_SOURCE = "the recording of a ride"


def build_from_recordings(
    recordings: Sequence[Path], name: str, output: Path | None, origin: tuple[float, float, float] | None, plot: bool
) -> None:
    """Raises CommandError, ConfigError."""
    folder, start = wanted(name, output, origin)
    for recording in recordings:
        if sum(recording.absolute() == other.absolute() for other in recordings) > 1:
            raise CommandError(f"{recording} is given twice", WRONG_USE)
    params, robot = load(MappingParams, "mapping"), load_robot()
    rides: dict[str, Ride] = {}
    warnings: list[str] = []
    with ProgressBar() as bar:
        for recording in recordings:
            reading = f"reading {recording}"
            ride, found = read_ride(recording, params.sweeps, robot, partial(bar, reading))
            rides[str(recording)] = ride
            warnings += found
        try:
            built = build_map(rides, params, robot, start, recognition(), bar)
        except RideError as error:
            where = f"{recordings[0]}: " if len(recordings) == 1 else ""
            raise CommandError(f"{where}{error}") from None
    warnings += wall_warnings(built, params.joining)
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    site = SiteMap(name, built.cells, built.grid, _about(built, start))
    with writing(folder):
        save_map(site, folder)
    if plot:
        poses, last = built.course.poses, np.flatnonzero(np.diff(built.course.ride)) + 1
        ends = np.array([[poses[k, :2, 3] for k in (loop.earlier, loop.later)] for loop in built.course.loops])
        draw_map(site, folder / "map.png", np.split(poses[:, :2, 3], last), ends)
    print("\n".join(lines_of(site)))
    print(f"written: {folder}")


def recognition() -> Recognition:
    """Localization's search of a whole map. Raises ConfigError."""
    ndt = load(LocalizationParams, "ndt_localization").ndt
    everywhere = Region(0.0, 0.0, math.inf)

    def of(cells: Cells) -> Finder:
        matcher = NdtMatcher(cells, ndt.match)

        def find(points: Floats, up: Floats) -> list[Floats]:
            # A place that explains much less than the best one is not it.
            matches = search(matcher, points, up, everywhere, ndt.search).rivals(ndt.search)
            return [match.pose for match in matches if match.structure >= ndt.gate.min_structure_points]

        return find

    return of


def wall_warnings(built: Built, settings: Joining) -> list[str]:
    """Warnings about rides whose walls do not agree."""
    return [
        f"{name}: its walls are {overlap.rms_m:.3f} m (rms) from those of the rides before it: look for doubled walls"
        for name, overlap in zip(built.names[1:], built.overlaps, strict=True)
        if overlap.rms_m > settings.wall_warning_m
    ]


def wanted(name: str, output: Path | None, origin: tuple[float, float, float] | None) -> tuple[Path, Pose2 | None]:
    """(folder of the map, its origin). Raises CommandError for invalid arguments."""
    if not _NAME.fullmatch(name):
        raise CommandError(f"name {name!r}: letters, digits and _ . - only", WRONG_USE)
    if origin is not None and not np.isfinite(origin).all():
        raise CommandError(f"origin must be three finite numbers, is {origin}", WRONG_USE)
    folder = (output if output is not None else config_dir() / "maps") / name
    return folder, None if origin is None else Pose2(*origin)


def _about(built: Built, start: Pose2 | None) -> dict[str, Any]:
    origin = start or Pose2(0.0, 0.0, 0.0)
    course = built.course
    length_m, duration_s = lengths(course)
    return {
        "frame": "map",
        "made_from": _SOURCE,
        "recording": Path(built.names[0]).absolute().name,
        "recorded": time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(float(course.stamps_s[0]))),
        "begins_at": place_of(origin),
        "ride": {
            "length_m": round(length_m, 1),
            "duration_s": round(duration_s, 1),
            "sweeps": len(course.sweeps),
        },
        **({"rides": rides_of(built)} if len(built.names) > 1 else {}),
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
    lines += [_line_of_ride(number, one) for number, one in enumerate(about.get("rides", ()), 1)]
    loops = sorted(found.get("loops", []), key=lambda loop: -float(loop["wheel_odometry_m"]))
    lines += [
        f"  loop between {_moment(loop, 'from')} and {_moment(loop, 'to')}: error of wheel odometry "
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


def _moment(loop: dict[str, Any], end: str) -> str:
    """An end of a loop in words."""
    return f"{loop[f'{end}_s']:g} s of " + (f"ride {loop[f'{end}_ride']}" if f"{end}_ride" in loop else "the ride")


def _line_of_ride(number: int, ride: dict[str, Any]) -> str:
    """A ride of several, and how it fits those before it."""
    line = f"ride {number}: {ride['recording']}, {ride['sweeps']} sweeps"
    if number == 1:
        return f"{line}; its start is the map's"
    line += f", joined by {ride['loops_with_those_before']} loops with those before it; "
    if ride["walls_apart_rms_m"] is None:
        return f"{line}no wall was seen by both"
    return f"{line}{ride['walls_of_both']} cells of walls seen by both are {ride['walls_apart_rms_m']} m apart (rms)"


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

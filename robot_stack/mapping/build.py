"""The complete map build from a ride, one step after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import Robot
from robot_stack.core.site_map import Cells, Grid
from robot_stack.mapping.cells import CellAccumulator, unpack_keys, voxel_keys
from robot_stack.mapping.grid import driven_cells, grid_of
from robot_stack.mapping.ground import Surface, bins_of, surface_of
from robot_stack.mapping.lidar_odometry import lidar_odometry
from robot_stack.mapping.loops import Loop, candidates, close_loops
from robot_stack.mapping.moving_objects import votes_of
from robot_stack.mapping.params import MappingParams
from robot_stack.mapping.pose_graph import Edges
from robot_stack.mapping.poses import Floats, inverse, planar, transform, yaw_of
from robot_stack.mapping.refinement import map_of, onto_map, thinned
from robot_stack.mapping.ride import Ride, RideError, driven
from robot_stack.mapping.trajectory import Knowledge

# (step, items done, items in all)
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class Built:
    """A map and its source: poses (n, 4, 4) of base_link in map at stamps_s by the map, by wheels, by LiDAR."""

    cells: Cells
    grid: Grid
    stamps_s: Floats
    poses: Floats
    by_wheels: Floats
    by_lidar: Floats
    loops: tuple[Loop, ...]
    moved_share: float


def build_map(ride: Ride, params: MappingParams, robot: Robot, origin: Pose2 | None, progress: Progress) -> Built:
    """origin: base_link in map at the ride's first sweep; None: the map begins there. Raises RideError."""
    start = origin or Pose2(0.0, 0.0, 0.0)
    sweeps = [sweep.points.astype(np.float64) for sweep in ride.sweeps]
    stamps = np.array([sweep.stamp_s for sweep in ride.sweeps])
    wheels = begun_at(driven(ride), start)
    progress("LiDAR odometry", 0, 1)
    lidar, matched = lidar_odometry(sweeps, wheels, params.lidar_odometry)
    knowledge = Knowledge(ride, wheels, lidar, matched, params)
    first = planar(start.x, start.y, start.yaw)
    poses, loops = _closed(sweeps, stamps, knowledge, first, wheels, params, progress)
    poses = _refined(sweeps, poses, knowledge, first, loops, params, progress, 1)
    static, share = _static(sweeps, poses, robot, params, progress)
    poses = _refined(static, poses, knowledge, first, loops, params, progress, params.refinement.rounds - 1)
    progress("cells and grid", 0, 1)
    cells = _cells(static, poses, params)
    grid = _grid(static, poses, robot, params)
    return Built(cells, grid, stamps, poses, wheels, lidar, tuple(loops), share)


def begun_at(poses: Floats, start: Pose2) -> Floats:
    """The same path, begun at ``start``; its slopes stay as they are."""
    first = planar(poses[0, 0, 3], poses[0, 1, 3], float(yaw_of(poses[:1])[0]))
    return planar(start.x, start.y, start.yaw) @ inverse(first) @ poses


def _closed(
    sweeps: list[Floats],
    stamps: Floats,
    knowledge: Knowledge,
    start: Floats,
    poses: Floats,
    params: MappingParams,
    progress: Progress,
) -> tuple[Floats, list[Loop]]:
    """Poses with loops closed. Two rounds: corrected poses show further places that are near each other."""
    loops: list[Loop] = []
    poses = knowledge.solve(poses, start, [])
    for turn in ("loops", "loops again"):
        pairs = candidates(poses, stamps, params.loops)
        loops = close_loops(sweeps, poses, pairs, params.loops, _ticks(progress, turn, len(pairs)))
        poses = knowledge.solve(poses, start, loops)
    return poses, loops


def _refined(
    sweeps: list[Floats],
    poses: Floats,
    knowledge: Knowledge,
    start: Floats,
    loops: list[Loop],
    params: MappingParams,
    progress: Progress,
    rounds: int,
) -> Floats:
    thin = [thinned(points, params.refinement) for points in sweeps]
    for _ in range(rounds):
        targets = map_of(sweeps, poses, params.refinement)
        tick = _ticks(progress, "fitting sweeps to the map", len(sweeps))
        fits = _fits_begun_at(start, onto_map(thin, poses, targets, params.refinement, tick))
        poses = knowledge.solve(poses, start, loops, [fits])
    return poses


def _fits_begun_at(start: Floats, fits: Edges) -> Edges:
    """The same fits, all moved so that the first sweep's is at ``start`` in place and heading.

    They constrain each other firmly: one sweep alone, held at the start, could not pull the others to its fit.
    """
    if not len(fits.second) or fits.second[0] != 0:
        return fits
    first = fits.measured[0]
    level = planar(float(first[0, 3]), float(first[1, 3]), float(yaw_of(first)))
    level[2, 3] = first[2, 3]
    return replace(fits, measured=start @ inverse(level) @ fits.measured)


def _static(
    sweeps: list[Floats], poses: Floats, robot: Robot, params: MappingParams, progress: Progress
) -> tuple[list[Floats], float]:
    """(sweeps without moving objects, share of points left out)."""
    surface = _surface(sweeps, poses, params)
    tick = _ticks(progress, "finding moving objects", len(sweeps))
    votes = votes_of(sweeps, poses, np.asarray(robot.lidar_xyz_m), params.moving_objects, tick)
    kept = []
    for points, pose in zip(sweeps, poses, strict=True):
        there = transform(pose, points)
        height = there[:, 2] - surface.below(there)
        high = height > params.moving_objects.above_ground_m
        gone = high & votes.moved(there)
        # Feet are removed with the body above: near the ground rays prove nothing.
        columns = np.concatenate([there[:, :2] / params.moving_objects.voxel_m, np.zeros((len(there), 1))], axis=1)
        around = _widened(columns[gone])
        feet = ~high & (height > params.grid.ground_band_m * 0.5)
        gone |= feet & np.isin(voxel_keys(columns, 1.0), around)
        kept.append(points[~gone])
    before, after = sum(map(len, sweeps)), sum(map(len, kept))
    return kept, 1.0 - after / before


def _widened(columns: Floats) -> np.ndarray:
    """Keys of the columns and of their eight neighbours."""
    offsets = [(float(i), float(j), 0.0) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    if not len(columns):
        return np.empty(0, np.int64)
    return np.unique(np.concatenate([voxel_keys(columns + offset, 1.0) for offset in np.array(offsets)]))


def _cells(sweeps: list[Floats], poses: Floats, params: MappingParams) -> Cells:
    s = params.cells
    accumulator = CellAccumulator(s.size_m)
    seen = []
    for points, pose in zip(sweeps, poses, strict=True):
        there = transform(pose, points[(points**2).sum(axis=1) < s.range_m**2])
        accumulator.add(there)
        seen.append(np.unique(voxel_keys(there, s.size_m)))
    cells = accumulator.cells(s.fewest_points)
    keys, count = np.unique(np.concatenate(seen), return_counts=True)
    often = {tuple(key) for key in unpack_keys(keys[count >= s.fewest_sweeps]).tolist()}
    kept = np.array([tuple(key) in often for key in cells.key.tolist()], bool)
    return Cells(cells.size_m, cells.key[kept], cells.mean[kept], cells.covariance[kept], cells.count[kept])


def _surface(sweeps: list[Floats], poses: Floats, params: MappingParams) -> Surface:
    bins = bins_of(_near(sweeps, poses, params), params.grid.resolution_m)
    return _ground(bins, poses, params)


def _ground(bins, poses: Floats, params: MappingParams) -> Surface:  # type: ignore[no-untyped-def]
    try:
        return surface_of(bins, poses[:, :3, 3], params.grid)
    except ValueError as error:
        raise RideError(str(error)) from error


def _grid(sweeps: list[Floats], poses: Floats, robot: Robot, params: MappingParams) -> Grid:
    bins = bins_of(_near(sweeps, poses, params), params.grid.resolution_m)
    surface = _ground(bins, poses, params)
    outline = robot.footprint
    half_m = min(outline.front_m, -outline.rear_m)
    return grid_of(bins, surface, driven_cells(surface, poses, half_m, 0.5 * outline.width_m), params.grid)


def _near(sweeps: list[Floats], poses: Floats, params: MappingParams):  # type: ignore[no-untyped-def]
    reach = params.grid.range_m**2
    return (transform(p, s[(s[:, :2] ** 2).sum(axis=1) < reach]) for s, p in zip(sweeps, poses, strict=True))


def _ticks(progress: Progress, what: str, total: int) -> Callable[[], None]:
    done = iter(range(1, total + 1))
    progress(what, 0, total)
    return lambda: progress(what, next(done, total), total)

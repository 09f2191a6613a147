"""The complete map build from a ride or several, one step after the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import Robot
from robot_stack.core.site_map import Cells, Grid
from robot_stack.mapping.cells import CellAccumulator, unpack_keys, voxel_keys
from robot_stack.mapping.course import Course, Progress, course_of, ticks
from robot_stack.mapping.grid import driven_cells, grid_of
from robot_stack.mapping.ground import Surface, bins_of, surface_of
from robot_stack.mapping.joining import Overlap, Recognition, joined, overlap
from robot_stack.mapping.moving_objects import votes_of
from robot_stack.mapping.params import MappingParams
from robot_stack.mapping.pose_graph import Edges
from robot_stack.mapping.poses import Floats, inverse, planar, transform, yaw_of
from robot_stack.mapping.refinement import map_of, onto_map, thinned
from robot_stack.mapping.ride import Ride, RideError


@dataclass(frozen=True, slots=True)
class Built:
    """A map and its source: the rides with their poses by the map, without moving objects; the names of the rides'
    recordings in the order of joining; the overlap of each but the first with those before it.
    """

    cells: Cells
    grid: Grid
    course: Course
    names: tuple[str, ...]
    overlaps: tuple[Overlap, ...]
    moved_share: float


def build_map(
    rides: Mapping[str, Ride],
    params: MappingParams,
    robot: Robot,
    origin: Pose2 | None,
    recognition: Recognition,
    progress: Progress,
) -> Built:
    """rides: by the names of their recordings. origin: base_link in map at the first ride's first sweep; None: the map
    begins there. recognition: places the other rides. Raises RideError.
    """
    start = origin or Pose2(0.0, 0.0, 0.0)
    courses = {name: course_of(ride, start, params, progress) for name, ride in rides.items()}
    first = planar(start.x, start.y, start.yaw)
    course, names = joined(courses, first, params, recognition, progress)
    course = _refined(course, first, params, progress, 1)
    static, share = _static(course, robot, params, progress)
    course = replace(course, sweeps=static)
    course = _refined(course, first, params, progress, params.refinement.rounds - 1)
    progress("cells and grid", 0, 1)
    overlaps = tuple(overlap(course, number, params) for number in range(1, len(names)))
    return Built(_cells(course, params), _grid(course, robot, params), course, tuple(names), overlaps, share)


def _refined(course: Course, start: Floats, params: MappingParams, progress: Progress, rounds: int) -> Course:
    thin = [thinned(points, params.refinement) for points in course.sweeps]
    for _ in range(rounds):
        targets = map_of(course.sweeps, course.poses, params.refinement)
        tick = ticks(progress, "fitting sweeps to the map", len(thin))
        fits = _fits_begun_at(start, onto_map(thin, course.poses, targets, params.refinement, tick))
        course = course.solved(start, params, [fits])
    return course


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


def _static(course: Course, robot: Robot, params: MappingParams, progress: Progress) -> tuple[list[Floats], float]:
    """(sweeps without moving objects, share of points left out)."""
    sweeps, poses = course.sweeps, course.poses
    surface = _surface(sweeps, poses, params)
    tick = ticks(progress, "finding moving objects", len(sweeps))
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


def _cells(course: Course, params: MappingParams) -> Cells:
    s = params.cells
    accumulator = CellAccumulator(s.size_m)
    seen = []
    for points, pose in zip(course.sweeps, course.poses, strict=True):
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


def _grid(course: Course, robot: Robot, params: MappingParams) -> Grid:
    poses = course.poses
    bins = bins_of(_near(course.sweeps, poses, params), params.grid.resolution_m)
    surface = _ground(bins, poses, params)
    outline = robot.footprint
    half_m = min(outline.front_m, -outline.rear_m)
    return grid_of(bins, surface, driven_cells(surface, poses, half_m, 0.5 * outline.width_m), params.grid)


def _near(sweeps: list[Floats], poses: Floats, params: MappingParams):  # type: ignore[no-untyped-def]
    reach = params.grid.range_m**2
    return (transform(p, s[(s[:, :2] ** 2).sum(axis=1) < reach]) for s, p in zip(sweeps, poses, strict=True))

"""One-way zones for navigation: the courses that each cell of a grid permits, and motion against a zone.

A course is the direction of motion of base_link in map, whatever the robot's heading. It is against a zone if it is
more than a tolerance off the zone's heading; the tolerance is above a right angle, so that zones can be crossed.
Where zones overlap, each of them counts.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from robot_stack.core.compiled import compiled
from robot_stack.core.geometry import wrap_angle
from robot_stack.core.site_map import Grid
from robot_stack.core.zones import Zone, ZoneType

Array = npt.NDArray[np.float64]
# (rows, columns) int64, a bit for each permitted course; (0, 0) if every course is permitted everywhere.
Courses = npt.NDArray[np.int64]
# Courses are counted from x, counter-clockwise; a multiple of the eight directions of a step between cells.
COURSES = 32
ALL_COURSES = (1 << COURSES) - 1
FREE_COURSES: Courses = np.zeros((0, 0), np.int64)


def limit_rad(tolerance_rad: float) -> float:
    """How far off a zone's heading a permitted course is at most: the middle of its step, and half a step."""
    return tolerance_rad + math.pi / COURSES


def permitted(zones: tuple[Zone, ...], grid: Grid, tolerance_rad: float) -> Courses:
    """The courses that the one-way zones permit in each cell of a grid."""
    ways = [zone for zone in zones if zone.type is ZoneType.ONE_WAY]
    if not ways:
        return FREE_COURSES
    courses = np.full(grid.occupancy.shape, ALL_COURSES, np.int64)
    for zone in ways:
        angles = (index * 2.0 * math.pi / COURSES for index in range(COURSES))
        along = [abs(wrap_angle(angle - zone.heading_rad)) <= tolerance_rad for angle in angles]
        mask = sum(1 << index for index, is_along in enumerate(along) if is_along)
        courses[zone.cells(grid)] &= mask
    return courses


def against_m(zones: tuple[Zone, ...], points: Array, tolerance_rad: float) -> float:
    """Length of the motion along (n, 2) points in map that is against a one-way zone, m."""
    steps = np.diff(points, axis=0)
    middle = points[:-1] + 0.5 * steps
    wrong = np.zeros(len(steps), np.bool_)
    for zone in zones:
        if zone.type is ZoneType.ONE_WAY:
            off = np.arctan2(steps[:, 1], steps[:, 0]) - zone.heading_rad
            against = np.cos(off) < math.cos(tolerance_rad)
            wrong |= against & zone.contains(middle[:, 0], middle[:, 1])
    return float(np.hypot(steps[:, 0], steps[:, 1])[wrong].sum())


@compiled(nogil=True)
def course_of(dx: float, dy: float) -> int:
    """The number of the course of a motion."""
    return round(math.atan2(dy, dx) / (2.0 * math.pi) * COURSES) % COURSES


@compiled(nogil=True)
def permits(courses: Courses, row: int, column: int, course: int) -> bool:
    """Whether a cell permits a course; outside the grid any."""
    if row < 0 or column < 0 or row >= courses.shape[0] or column >= courses.shape[1]:
        return True
    return bool((courses[row, column] >> course) & 1)


@compiled(nogil=True)
def coarse_courses(courses: Courses, factor: int) -> Courses:
    """Courses that all fine cells of a coarse cell permit, ``factor`` x ``factor`` of them."""
    rows = (courses.shape[0] + factor - 1) // factor
    columns = (courses.shape[1] + factor - 1) // factor
    out = np.empty((rows, columns), np.int64)
    for r in range(rows):
        for c in range(columns):
            both = courses[r * factor, c * factor]
            for i in range(r * factor, min((r + 1) * factor, courses.shape[0])):
                for j in range(c * factor, min((c + 1) * factor, courses.shape[1])):
                    both &= courses[i, j]
            out[r, c] = both
    return out

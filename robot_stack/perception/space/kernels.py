"""Compiled loops over the cells of the space.

Grids are (rows, columns), row 0 at the lowest y.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.perception.polar import PI, angle_of
from robot_stack.perception.space.view import BIN_M

Cells = NDArray[np.int8]
Floats = NDArray[np.float64]
Float = NDArray[np.float32]
Corner = NDArray[np.int64]


class Layers(NamedTuple):
    """What is known of each cell, (rows, columns); times in s, -inf for never.

    passes: consecutive views with a ray through an occupied cell. last: (rows, columns, 3) the highest return of the
    last view that hit the cell: place in the cell, and height above the ground. thing_m: of the object it is part of:
    the highest return near it. under_m: the lowest such return since the cell became occupied, at since_s.
    found: it was unseen before: the object may have stood there. hit_at_m: the robot's travel at hit_s.
    ray_m, ray_s: height of the lowest recent ray of any sensor, and its time. watched_s: of the last low ray.
    freed_s: when rays last freed it. held_s: when returns beside it kept it. stood_s: when ``stand`` occupied it.
    """

    state: Cells
    passes: Any
    last: Float
    thing_m: Float
    under_m: Float
    found: Any
    hit_at_m: Floats
    ray_m: Float
    hit_s: Floats
    since_s: Floats
    ray_s: Floats
    watched_s: Floats
    freed_s: Floats
    held_s: Floats
    stood_s: Floats


class Where(NamedTuple):
    """corner: (2,) the cell of row 0, column 0, by the integers floor(x / cell) and floor(y / cell) in odom.
    pose: (4,) x, y, cos and sin of the yaw of base_link in odom.
    """

    corner: Corner
    cell_m: float
    pose: Floats


class Rays(NamedTuple):
    """Of a view: see ``View``."""

    origin: Floats
    up: float
    ground: Float
    passed: Float
    bare: Any


UNSEEN, FREE, OCCUPIED = np.int8(-1), np.int8(0), np.int8(100)
# Indices in ``limits``, used by ``look``.
PASSES, MARGIN_M, FREE_BELOW_M, WATCHED_BELOW_M, MEMORY_M, LOW_M = range(6)
_ALIKE_M = np.float32(0.02)  # difference by noise between the same rays of two views
_SPECK = 3  # fewer unseen cells around an unseen one: a gap between rays, too small for a person


@compiled(error_model="numpy")
def mark(
    layers: Layers, where: Where, rays: Rays, hits: Float, own: Floats, thing_cells: int, now_s: float, travel_m: float
) -> None:
    """Makes the cells of returns occupied.

    thing_m: the highest return within ``thing_cells``, because a foot belongs to the body above it.
    """
    state, passes, thing_m, under_m = layers.state, layers.passes, layers.thing_m, layers.under_m
    hit_s, hit_at_m, since_s, found = layers.hit_s, layers.hit_at_m, layers.since_s, layers.found
    last = layers.last
    corner, cell_m, pose = where
    origin, ground = rays.origin, rays.ground
    rows, columns = state.shape
    directions, bins = ground.shape
    lowest = np.full((rows, columns), np.inf, np.float32)
    hit_rows, hit_columns = np.empty(len(hits), np.int32), np.empty(len(hits), np.int32)
    count = 0
    for i in range(len(hits)):
        x, y, z = hits[i, 0], hits[i, 1], hits[i, 2]
        if not math.isfinite(x + y + z):
            continue
        if own[0] <= x <= own[1] and abs(y) <= own[2]:
            continue
        across = (pose[0] + pose[2] * x - pose[3] * y) / cell_m - corner[0]
        along = (pose[1] + pose[3] * x + pose[2] * y) / cell_m - corner[1]
        column, row = math.floor(across), math.floor(along)
        if not (0 <= row < rows and 0 <= column < columns):
            continue
        dx, dy = np.float32(x - origin[0]), np.float32(y - origin[1])
        s = min(int((angle_of(dy, dx) + PI) / (2.0 * math.pi) * directions), directions - 1)
        b = min(int(math.sqrt(dx * dx + dy * dy) / BIN_M), bins - 1)
        height = z - ground[s, b]
        lowest[row, column] = min(lowest[row, column], height)
        if hit_s[row, column] != now_s:
            hit_rows[count], hit_columns[count] = row, column
            count += 1
            hit_s[row, column] = now_s
        elif height <= last[row, column, 2]:
            continue
        last[row, column, 0], last[row, column, 1], last[row, column, 2] = across - column, along - row, height
        if state[row, column] != OCCUPIED:
            since_s[row, column], found[row, column] = now_s, state[row, column] != FREE
        state[row, column], passes[row, column], hit_at_m[row, column] = OCCUPIED, 0, travel_m
    for i in range(count):
        row, column = hit_rows[i], hit_columns[i]
        top = last[row, column, 2]
        under = lowest[row, column] if since_s[row, column] == now_s else under_m[row, column]
        for r in range(max(row - thing_cells, 0), min(row + thing_cells + 1, rows)):
            for c in range(max(column - thing_cells, 0), min(column + thing_cells + 1, columns)):
                if hit_s[r, c] == now_s:
                    top, under = max(top, last[r, c, 2]), min(under, lowest[r, c])
        thing_m[row, column], under_m[row, column] = top, under


@compiled(error_model="numpy")
def appeared(layers: Layers, where: Where, hits: Float, apart: int, after_s: float, out: Floats) -> int:
    """Returns in cells that became occupied after ``after_s``, without older obstacles within ``apart`` cells.

    Call ``mark`` first. hits: (n, 3) base_link. out: (n, 5) of each cell the mean return, x and y in
    odom and z, 1 if the cell was free before and 0 if unseen, and the number of returns. Returns the number of cells.
    """
    state, since_s, found = layers.state, layers.since_s, layers.found
    corner, cell_m, pose = where
    rows, columns = state.shape
    count, index = 0, np.zeros((rows, columns), np.int32)  # index of a cell in out, from 1, -1: not new
    for i in range(len(hits)):
        x, y = hits[i, 0], hits[i, 1]
        if not math.isfinite(x + y):
            continue
        u, v = pose[0] + pose[2] * x - pose[3] * y, pose[1] + pose[3] * x + pose[2] * y
        column, row = math.floor(u / cell_m) - corner[0], math.floor(v / cell_m) - corner[1]
        if not (apart <= row < rows - apart and apart <= column < columns - apart):
            continue
        k = index[row, column] - 1
        if k < -1:
            continue
        if k >= 0:
            out[k, 4] += 1.0
            out[k, 0] += (u - out[k, 0]) / out[k, 4]
            out[k, 1] += (v - out[k, 1]) / out[k, 4]
            out[k, 2] += (hits[i, 2] - out[k, 2]) / out[k, 4]
            continue
        index[row, column] = -1
        if state[row, column] != OCCUPIED or since_s[row, column] < after_s:  # the robot's own place, or it stands
            continue
        stands = False
        for r in range(row - apart, row + apart + 1):
            for c in range(column - apart, column + apart + 1):
                stands |= state[r, c] == OCCUPIED and since_s[r, c] < after_s
        if not stands and count < len(out):
            out[count, 0], out[count, 1], out[count, 2] = u, v, hits[i, 2]
            out[count, 3], out[count, 4] = 0.0 if found[row, column] else 1.0, 1.0
            count += 1
            index[row, column] = count
    return count


@compiled(error_model="numpy")
def stand(
    layers: Layers, where: Where, points: Floats, below_m: float, unwatched_s: float, now_s: float, travel_m: float
) -> None:
    """Makes the cells of points (n, 3), x and y in odom, occupied where no ray lower than ``below_m`` has passed since
    ``unwatched_s``.

    They count as observed in ``hit_s``, without a return.
    """
    state, passes, thing_m, under_m = layers.state, layers.passes, layers.thing_m, layers.under_m
    hit_s, hit_at_m, since_s, stood_s = layers.hit_s, layers.hit_at_m, layers.since_s, layers.stood_s
    ray_s, ray_m, last = layers.ray_s, layers.ray_m, layers.last
    corner, cell_m, _ = where
    rows, columns = state.shape
    for i in range(len(points)):
        across, along = points[i, 0] / cell_m - corner[0], points[i, 1] / cell_m - corner[1]
        column, row = math.floor(across), math.floor(along)
        if not (0 <= row < rows and 0 <= column < columns):
            continue
        if ray_s[row, column] >= unwatched_s and ray_m[row, column] <= below_m:
            continue
        if state[row, column] != OCCUPIED:
            last[row, column, 2], thing_m[row, column], under_m[row, column] = points[i, 2], points[i, 2], 0.0
            last[row, column, 0], last[row, column, 1] = across - column, along - row
            since_s[row, column], hit_s[row, column], stood_s[row, column] = -math.inf, now_s, now_s
        state[row, column], passes[row, column], hit_at_m[row, column] = OCCUPIED, 0, travel_m


@compiled(error_model="numpy")
def hold(layers: Layers, where: Where, specks: Float, now_s: float) -> None:
    """Resets the passes through an occupied cell while there are returns from it or right beside it.

    Call before ``look``. specks: (n, 3) base_link, m."""
    state, passes, held_s = layers.state, layers.passes, layers.held_s
    corner, cell_m, pose = where
    rows, columns = state.shape
    for i in range(len(specks)):
        x, y = specks[i, 0], specks[i, 1]
        if not math.isfinite(x + y):
            continue
        column = math.floor((pose[0] + pose[2] * x - pose[3] * y) / cell_m - corner[0])
        row = math.floor((pose[1] + pose[3] * x + pose[2] * y) / cell_m - corner[1])
        for r in range(max(row - 1, 0), min(row + 2, rows)):
            for c in range(max(column - 1, 0), min(column + 2, columns)):
                if state[r, c] == OCCUPIED:
                    passes[r, c], held_s[r, c] = 0, now_s


@compiled(error_model="numpy")
def look(
    layers: Layers, where: Where, rays: Rays, own: Floats, limits: Floats, lasts_s: float, now_s: float, travel_m: float
) -> None:
    """Updates the cells by the rays of one view; call ``mark`` before and ``fade`` after it.

    A ray is recent for ``lasts_s``.

    own: rear, front, half width of the robot's own place, m, which is free. No ray passes below the top of an object
    hardly higher than the ground: ground observed in its place frees it. Where the sensor's highest beam is lower than
    an object, rays below its top do not free it.
    """
    state, passes, thing_m, under_m = layers.state, layers.passes, layers.thing_m, layers.under_m
    hit_s, hit_at_m, watched_s, freed_s = layers.hit_s, layers.hit_at_m, layers.watched_s, layers.freed_s
    ray_s, ray_m = layers.ray_s, layers.ray_m
    corner, cell_m, pose = where
    origin, up, ground, passed, bare = rays
    rows, columns = state.shape
    directions, bins = passed.shape
    per_rad, half_m = np.float32(directions / (2.0 * math.pi)), np.float32(0.71 * cell_m)
    xs, ys = np.empty(columns, np.float32), np.empty(columns, np.float32)
    ats, aways = np.empty(columns, np.float32), np.empty(columns, np.float32)
    for row in range(rows):
        _bearings(row + corner[1], corner[0], cell_m, pose, origin, per_rad, xs, ys, ats, aways)
        for column in range(columns):
            if own[0] <= xs[column] <= own[1] and abs(ys[column]) <= own[2]:
                state[row, column], watched_s[row, column] = FREE, now_s
                ray_s[row, column] = -np.inf
                continue
            was = state[row, column]
            if was == OCCUPIED and travel_m - hit_at_m[row, column] > limits[MEMORY_M]:
                state[row, column] = was = UNSEEN
            away, at = aways[column], ats[column]
            b, s = int(away * np.float32(1.0 / BIN_M)), min(int(at), directions - 1)
            if b >= bins or math.isnan(passed[s, 0]):
                continue  # out of reach, or not covered by the sensor
            # Every direction that meets the cell must have passed it: rays pass beside a pole.
            wide = half_m / max(away, half_m) * per_rad
            least = np.float32(-1.0)
            for i in range(math.floor(at - wide), math.floor(at + wide) + 1):
                height = passed[i - directions if i >= directions else i, b]
                if height > least:  # false where the sensor has no coverage
                    least = height
                if least == np.inf:
                    break
            if least < np.float32(0.0) or least == np.inf:
                continue
            if least <= limits[WATCHED_BELOW_M]:
                watched_s[row, column] = now_s
            if least <= ray_m[row, column] + _ALIKE_M or now_s - ray_s[row, column] > lasts_s:
                ray_m[row, column], ray_s[row, column] = least, now_s
            if was == OCCUPIED:
                if hit_s[row, column] == now_s:
                    continue
                highest = origin[2] + up * away - ground[s, b]
                gone = least < thing_m[row, column] - limits[MARGIN_M]
                gone &= under_m[row, column] + limits[MARGIN_M] < highest
                if not gone and thing_m[row, column] <= limits[LOW_M]:
                    gone = True
                    for i in range(math.floor(at - wide), math.floor(at + wide) + 1):
                        gone &= bare[i - directions if i >= directions else i, b]
                if gone:
                    passes[row, column] += 1
                    if passes[row, column] >= limits[PASSES]:
                        state[row, column] = FREE if least <= limits[FREE_BELOW_M] else UNSEEN
                        freed_s[row, column] = now_s
            elif was == UNSEEN and least <= limits[FREE_BELOW_M]:
                state[row, column] = FREE


@compiled(error_model="numpy")
def vanished(
    layers: Layers,
    where: Where,
    own: Floats,
    limits: Floats,
    apart: int,
    near: int,
    moved: int,
    stood_s: float,
    recent_s: float,
    lasts_s: float,
    now_s: float,
    out: Floats,
) -> int:
    """Cells that this view freed although the object did not go on in view: it is in the unobserved space beside them.

    Call after ``look``. The object was observed in the cell for ``stood_s`` and until less than ``recent_s`` ago. Since
    then nothing returned within ``near`` cells, nothing new within ``moved`` cells, and on the straight way to ``own``
    a place within ``near`` cells is passed above the object, or above a person, only. lasts_s: age of recent rays.
    out: (n, 3) x, y in odom and the height of the object. Returns their number.
    """
    state, thing_m, hit_s, since_s = layers.state, layers.thing_m, layers.hit_s, layers.since_s
    held_s, freed_s = layers.held_s, layers.freed_s
    corner, cell_m, _ = where
    rows, columns = state.shape
    count = 0
    for row in range(moved + apart, rows - moved - apart):
        for column in range(moved + apart, columns - moved - apart):
            hit, top = max(hit_s[row, column], held_s[row, column]), thing_m[row, column]
            if freed_s[row, column] != now_s or now_s - hit > recent_s or hit - since_s[row, column] < stood_s:
                continue
            if top <= limits[LOW_M] or count >= len(out):
                continue
            x, y = (column + corner[0] + 0.5) * cell_m, (row + corner[1] + 0.5) * cell_m
            if not _hides(layers, where, own, x, y, top, near, limits, now_s - lasts_s):
                continue
            if _goes_on(layers, row, column, near, moved, apart, hit, now_s - lasts_s):
                continue
            out[count, 0], out[count, 1], out[count, 2] = x, y, top
            count += 1
    return count


@compiled(error_model="numpy")
def _hides(
    layers: Layers, where: Where, own: Floats, x: float, y: float, top: float, near: int, limits: Floats, since_s: float
) -> bool:
    """True if on the way from (x, y) to the robot's own place a stretch of ``near`` cells, or all that is left, begins
    at most ``near`` cells away in which no ray is low enough: more than the gap between two rings."""
    ray_s, ray_m = layers.ray_s, layers.ray_m
    corner, cell_m, pose = where
    dx, dy = x - pose[0], y - pose[1]
    u, v = pose[2] * dx + pose[3] * dy, pose[2] * dy - pose[3] * dx
    to_u, to_v = min(max(u, own[0]), own[1]) - u, min(max(v, -own[2]), own[2]) - v
    away_m = math.sqrt(to_u * to_u + to_v * to_v)
    shows_m = min(top - limits[MARGIN_M], limits[WATCHED_BELOW_M])
    hidden = 0
    for step in range(1, 2 * near + 1):
        if step * cell_m >= away_m:
            break
        share = step * cell_m / away_m
        on_x = x + share * (pose[2] * to_u - pose[3] * to_v)
        on_y = y + share * (pose[3] * to_u + pose[2] * to_v)
        row, column = math.floor(on_y / cell_m) - corner[1], math.floor(on_x / cell_m) - corner[0]
        if ray_s[row, column] < since_s or ray_m[row, column] > shows_m:
            hidden += 1
            if hidden == near:
                return True
        elif hidden or step >= near:
            return False
    return hidden > 0


@compiled(error_model="numpy")
def _goes_on(
    layers: Layers, row: int, column: int, near: int, moved: int, apart: int, hit: float, fresh_s: float
) -> bool:
    """True if there are returns since ``fresh_s`` within ``near`` cells, or within ``moved`` cells returns from cells
    occupied since the ``hit``, with nothing older within ``apart`` cells: the object is seen there."""
    state, hit_s, since_s = layers.state, layers.hit_s, layers.since_s
    for r in range(row - moved, row + moved + 1):
        for c in range(column - moved, column + moved + 1):
            if state[r, c] != OCCUPIED or hit_s[r, c] < fresh_s:
                continue
            if abs(r - row) <= near and abs(c - column) <= near:
                return True
            if since_s[r, c] < hit:
                continue
            new = True
            for i in range(r - apart, r + apart + 1):
                for j in range(c - apart, c + apart + 1):
                    new &= not (state[i, j] == OCCUPIED and since_s[i, j] < hit)
            if new:
                return True
    return False


@compiled(error_model="numpy")
def _bearings(
    row: int,
    first_column: int,
    cell_m: float,
    pose: Floats,
    origin: Floats,
    per_rad: Any,
    xs: Float,
    ys: Float,
    ats: Float,
    aways: Float,
) -> None:
    """Bearings of a row's cell centres: x and y in base_link; direction around the sensor, in steps, and distance.

    Arithmetic alone, for vector code.
    """
    cos, sin = np.float32(pose[2]), np.float32(pose[3])
    dy, first = np.float32((row + 0.5) * cell_m - pose[1]), np.float32((first_column + 0.5) * cell_m - pose[0])
    step, x0, y0 = np.float32(cell_m), np.float32(origin[0]), np.float32(origin[1])
    for column in range(len(xs)):
        dx = first + step * np.float32(column)
        x, y = cos * dx + sin * dy, cos * dy - sin * dx
        xs[column], ys[column] = x, y
        x, y = x - x0, y - y0
        aways[column] = np.float32(math.sqrt(x * x + y * y))
        ats[column] = (angle_of(y, x) + PI) * per_rad


@compiled(error_model="numpy")
def fade(layers: Layers, enter_cells: int, fade_s: float, now_s: float, stack: Corner) -> None:
    """Makes free cells unseen if no ray passes them any longer and a person could have entered them.

    A person enters such a cell from another unseen one, from beyond the grid, or from returns beside it, at most
    ``enter_cells`` away: a hollow within observed space, as before a passenger's knees, stays free until then.
    stack: (rows * columns,) memory.
    """
    state, watched_s = layers.state, layers.watched_s
    rows, columns = state.shape
    hidden = np.empty((rows, columns), np.bool_)
    for row in range(rows):
        for column in range(columns):
            hidden[row, column] = not now_s - watched_s[row, column] <= fade_s
    count = 0
    for row in range(rows):
        for column in range(columns):
            border = row in (0, rows - 1) or column in (0, columns - 1)
            if border and hidden[row, column]:
                hidden[row, column] = False
                stack[count] = row * columns + column
                count += 1
            if state[row, column] != OCCUPIED:
                continue
            for r in range(max(row - enter_cells, 0), min(row + enter_cells + 1, rows)):
                for c in range(max(column - enter_cells, 0), min(column + enter_cells + 1, columns)):
                    if hidden[r, c]:
                        hidden[r, c] = False
                        stack[count] = r * columns + c
                        count += 1
    while count:
        count -= 1
        row, column = stack[count] // columns, stack[count] % columns
        if state[row, column] == FREE:
            state[row, column] = UNSEEN
        for r, c in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
            if 0 <= r < rows and 0 <= c < columns and hidden[r, c]:
                hidden[r, c] = False
                stack[count] = r * columns + c
                count += 1


@compiled(error_model="numpy")
def remembered(layers: Layers, where: Where, before_s: float, out: Float) -> int:
    """Occupied cells whose last hit is before ``before_s``: (n, 3) base_link, that hit. Returns their number."""
    state, last, hit_s = layers.state, layers.last, layers.hit_s
    corner, cell_m, pose = where
    rows, columns = state.shape
    count = 0
    for row in range(rows):
        for column in range(columns):
            if state[row, column] == OCCUPIED and hit_s[row, column] < before_s and count < len(out):
                dx = (column + corner[0] + last[row, column, 0]) * cell_m - pose[0]
                dy = (row + corner[1] + last[row, column, 1]) * cell_m - pose[1]
                out[count, 0] = pose[2] * dx + pose[3] * dy
                out[count, 1] = pose[2] * dy - pose[3] * dx
                out[count, 2] = last[row, column, 2]
                count += 1
    return count


@compiled(error_model="numpy")
def frontier(layers: Layers, where: Where, radius_m: float, out: Float) -> int:
    """Unseen cells beside free ones: (n, 3) base_link, z 0. Returns their number."""
    state = layers.state
    corner, cell_m, pose = where
    rows, columns = state.shape
    count = 0
    for row in range(1, rows - 1):
        dy = (row + corner[1] + 0.5) * cell_m - pose[1]
        for column in range(1, columns - 1):
            if state[row, column] != UNSEEN or count >= len(out):
                continue
            beside = (
                state[row - 1, column] == FREE
                or state[row + 1, column] == FREE
                or state[row, column - 1] == FREE
                or state[row, column + 1] == FREE
            )
            if not beside:
                continue
            unseen = 0
            for r in range(row - 1, row + 2):
                for c in range(column - 1, column + 2):
                    unseen += state[r, c] == UNSEEN
            dx = (column + corner[0] + 0.5) * cell_m - pose[0]
            if unseen - 1 >= _SPECK and dx * dx + dy * dy <= radius_m * radius_m:
                out[count, 0] = pose[2] * dx + pose[3] * dy
                out[count, 1] = pose[2] * dy - pose[3] * dx
                out[count, 2] = 0.0
                count += 1
    return count


@compiled(error_model="numpy")
def fill(cells: Any, corner: Corner, cell_m: float, pose: Floats, rect: Floats, value: Any) -> None:
    """Sets the cells of a rectangle: rear, front, half width in base_link, m."""
    rows, columns = cells.shape
    reach = int(math.hypot(max(rect[1], -rect[0]), rect[2]) / cell_m) + 2
    at_row, at_column = math.floor(pose[1] / cell_m) - corner[1], math.floor(pose[0] / cell_m) - corner[0]
    for row in range(max(at_row - reach, 0), min(at_row + reach + 1, rows)):
        dy = (row + corner[1] + 0.5) * cell_m - pose[1]
        for column in range(max(at_column - reach, 0), min(at_column + reach + 1, columns)):
            dx = (column + corner[0] + 0.5) * cell_m - pose[0]
            x, y = pose[2] * dx + pose[3] * dy, pose[2] * dy - pose[3] * dx
            if rect[0] <= x <= rect[1] and abs(y) <= rect[2]:
                cells[row, column] = value

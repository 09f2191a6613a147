"""Compiled loops of the local controller: candidate motions along the route, rolled out and scored.

Everything is in the costmap's frame. A candidate is (offset, speed share, heading offset): drive along the route at
this distance to its left, at this share of the allowed speed, turned by this angle. The rollout is closed-loop under
the acceleration limits, so that every candidate is feasible.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from robot_stack.core.compiled import compiled

Floats = npt.NDArray[np.float64]
Singles = npt.NDArray[np.float32]

# Columns of a route: x, y, yaw, arc length, largest speed there.
_X, _Y, _YAW, _ALONG, _SPEED = 0, 1, 2, 3, 4
COLLISION = 1e3


@compiled
def wrapped(angle: float) -> float:
    return math.atan2(math.sin(angle), math.cos(angle))


@compiled
def clearance(
    field: Singles, resolution_m: float, ox: float, oy: float, outline: Floats, x: float, y: float, yaw: float
) -> float:
    """Metres from the outline at a pose to the nearest obstacle cell's middle; 10 off the grid."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    least = 10.0
    for i in range(len(outline)):
        c = math.floor((x + cos * outline[i, 0] - sin * outline[i, 1] - ox) / resolution_m)
        r = math.floor((y + sin * outline[i, 0] + cos * outline[i, 1] - oy) / resolution_m)
        if 0 <= r < field.shape[0] and 0 <= c < field.shape[1]:
            least = min(least, float(field[r, c]))
    return least


@compiled
def along_poses(field: Singles, resolution_m: float, ox: float, oy: float, outline: Floats, poses: Floats) -> Floats:
    """(n,) clearance at (n, 3+) poses."""
    out = np.empty(len(poses))
    for i in range(len(poses)):
        out[i] = clearance(field, resolution_m, ox, oy, outline, poses[i, 0], poses[i, 1], poses[i, 2])
    return out


@compiled
def person_gap(box: Floats, x: float, y: float, yaw: float, px: float, py: float, radius: float) -> float:
    """Metres between the footprint at a pose and a person; box: front, rear, half width of the footprint."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    dx, dy = px - x, py - y
    bx, by = cos * dx + sin * dy, -sin * dx + cos * dy
    ax = max(bx - box[0], box[1] - bx, 0.0)
    ay = max(abs(by) - box[2], 0.0)
    return math.hypot(ax, ay) - radius


@compiled
def _drives_at(box: Floats, x: float, y: float, yaw: float, start: Floats, person: Floats, time: float) -> bool:
    """True if the pose at ``time`` is within a person's least gap, and nearer than ``start`` would be then.

    The robot may move away from a person who is already within that gap.
    """
    px, py = person[0] + time * person[2], person[1] + time * person[3]
    gap = person_gap(box, x, y, yaw, px, py, person[4])
    now = person_gap(box, start[0], start[1], start[2], person[0], person[1], person[4])
    if gap >= min(person[5], max(now, 0.0)):
        return False
    return gap < person_gap(box, start[0], start[1], start[2], px, py, person[4]) - 0.01


@compiled
def free_time(
    field: Singles, resolution_m: float, ox: float, oy: float, outline: Floats, pose: Floats, twist: Floats,
    margin_m: float, horizon_s: float, box: Floats, people: Floats,
) -> float:  # fmt: skip
    """How long the footprint stays clear by margin_m if the twist goes on unchanged, seconds, at most horizon_s.

    For people (see evaluate) by the least gap of each; an approach by the person's walking alone does not count.
    """
    x, y, yaw = pose[0], pose[1], pose[2]
    step = 0.1
    steps = math.ceil(horizon_s / step)
    for i in range(steps):
        middle = yaw + 0.5 * step * twist[2]
        x += step * (math.cos(middle) * twist[0] - math.sin(middle) * twist[1])
        y += step * (math.sin(middle) * twist[0] + math.cos(middle) * twist[1])
        yaw += step * twist[2]
        if clearance(field, resolution_m, ox, oy, outline, x, y, yaw) < margin_m:
            return i * step
        for p in range(len(people)):
            # Predicted and present position: people may stop.
            for time in ((i + 1) * step, 0.0):
                if _drives_at(box, x, y, yaw, pose, people[p], time):
                    return i * step
    return horizon_s


@compiled
def _nearest(route: Floats, start: int, x: float, y: float) -> int:
    """Index of the nearest route point from ``start`` on, while the distance decreases."""
    best = start
    best2 = (route[start, _X] - x) ** 2 + (route[start, _Y] - y) ** 2
    for i in range(start + 1, min(start + 12, len(route))):
        d2 = (route[i, _X] - x) ** 2 + (route[i, _Y] - y) ** 2
        if d2 < best2:
            best, best2 = i, d2
    return best


@compiled
def evaluate(
    candidates: Floats, route: Floats, pose: Floats, twist: Floats, limits: Floats, step_s: float, steps: int,
    field: Singles, resolution_m: float, ox: float, oy: float, outline: Floats, box: Floats, reach_m: float,
    hard_m: float, soft_m: float, people: Floats, person_m: float, weights: Floats,
    last_offset: float,
) -> tuple[Floats, Floats, Floats]:  # fmt: skip
    """Rolls candidates out: (costs (n,), first twists (n, 3) after step_s, least clearances (n,)).

    limits: speed, yaw rate, acceleration, yaw acceleration. people: (m, 6) x, y, vx, vy, radius now, least gap.
    weights: progress, offset, heading, clearance, person, change of offset.
    """
    n = len(candidates)
    costs, firsts, nearest = np.empty(n), np.empty((n, 3)), np.empty(n)
    last = len(route) - 1
    begin = 0
    best2 = 1e18
    for i in range(len(route)):
        d2 = (route[i, _X] - pose[0]) ** 2 + (route[i, _Y] - pose[1]) ** 2
        if d2 < best2 and route[i, _ALONG] < 3.0:
            begin, best2 = i, d2
    speed_max, rate_max, acceleration, rate_change = limits[0], limits[1], limits[2], limits[3]
    for k in range(n):
        offset, share, turn = candidates[k, 0], candidates[k, 1], candidates[k, 2]
        x, y, yaw = pose[0], pose[1], pose[2]
        vx, vy, w = twist[0], twist[1], twist[2]
        at, cost, least = begin, 0.0, 10.0
        for i in range(steps):
            at = _nearest(route, at, x, y)
            speed = math.hypot(vx, vy)
            look = at + int((0.35 + 0.5 * speed) * 10.0)
            target = min(look, last)
            tangent = math.atan2(
                route[min(target + 1, last), _Y] - route[max(target - 1, 0), _Y],
                route[min(target + 1, last), _X] - route[max(target - 1, 0), _X],
            )
            # Towards the end of the route the offset fades: the goal lies on it.
            beside = offset * min(1.0, (route[last, _ALONG] - route[target, _ALONG]) / 0.5)
            gx = route[target, _X] - math.sin(tangent) * beside - x
            gy = route[target, _Y] + math.cos(tangent) * beside - y
            far = math.hypot(gx, gy)
            towards = wrapped(route[min(at + 3, last), _YAW] + turn - yaw)
            requested = share * min(speed_max, route[at, _SPEED]) * max(0.15, 1.0 - abs(towards) / 1.2)
            left = far + route[last, _ALONG] - route[target, _ALONG]
            requested = min(requested, math.sqrt(1.4 * acceleration * left), 1.5 * left)
            wx, wy = (requested * gx / far, requested * gy / far) if far > 1e-6 else (0.0, 0.0)
            cos, sin = math.cos(yaw), math.sin(yaw)
            ax, ay = cos * wx + sin * wy - vx, -sin * wx + cos * wy - vy
            size = math.hypot(ax, ay)
            factor = min(1.0, acceleration * step_s / size) if size > 0.0 else 0.0
            vx, vy = vx + factor * ax, vy + factor * ay
            # A speed share of zero also means no turning.
            rate = max(-rate_max, min(rate_max, 1.5 * towards)) if share > 0.0 else 0.0
            w += max(-rate_change * step_s, min(rate_change * step_s, rate - w))
            if i == 0:
                firsts[k, 0], firsts[k, 1], firsts[k, 2] = vx, vy, w
            middle = yaw + 0.5 * step_s * w
            x += step_s * (math.cos(middle) * vx - math.sin(middle) * vy)
            y += step_s * (math.sin(middle) * vx + math.cos(middle) * vy)
            yaw += step_s * w
            cx, cy = x + math.cos(yaw) * box[3], y + math.sin(yaw) * box[3]
            c = math.floor((cx - ox) / resolution_m)
            r = math.floor((cy - oy) / resolution_m)
            if 0 <= r < field.shape[0] and 0 <= c < field.shape[1] and field[r, c] > reach_m + soft_m:
                clear = float(field[r, c]) - reach_m
            else:
                clear = clearance(field, resolution_m, ox, oy, outline, x, y, yaw)
            least = min(least, clear)
            moving = abs(vx) + abs(vy) + abs(w) > 1e-3
            if clear < hard_m:
                if moving:
                    cost += COLLISION * (1.0 + 0.1 * (steps - i))
                    break
                cost += 1.0
            elif clear < soft_m:
                share_near = (soft_m - clear) / (soft_m - hard_m)
                # Per metre: a slow pass costs no more for its duration.
                cost += weights[3] * share_near * share_near * math.hypot(vx, vy) * step_s
            if moving:
                time = (i + 1) * step_s
                for p in range(len(people)):
                    px, py = people[p, 0] + time * people[p, 2], people[p, 1] + time * people[p, 3]
                    gap = person_gap(box, x, y, yaw, px, py, people[p, 4] + 0.06 * time)
                    if _drives_at(box, x, y, yaw, pose, people[p], time):
                        cost += COLLISION * 0.5 * (1.0 - 0.5 * i / steps)
                    elif gap < person_m and (people[p, 2] != 0.0 or people[p, 3] != 0.0):
                        # Per metre, and not for standing people: else waiting for ever would cost less than any pass.
                        cost += weights[4] * (person_m - gap) / person_m * math.hypot(vx, vy) * step_s
        progress = route[at, _ALONG] - route[begin, _ALONG]
        off = math.hypot(route[at, _X] - x, route[at, _Y] - y)
        cost += weights[0] * (speed_max * step_s * steps - progress)
        cost += weights[1] * (offset * offset + off * off) + weights[2] * turn * turn
        cost += weights[5] * (offset - last_offset) ** 2
        costs[k], nearest[k] = cost, least
    return costs, firsts, nearest

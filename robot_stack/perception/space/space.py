"""The model of the space around the robot. Stamps in s, one clock; poses are base_link in odom.

A cell is FREE only if a ray has passed it, and while no person could have entered it unobserved. It is
OCCUPIED from a return on until a ray of a sensor with a high enough field of view passes below its top, or until ground
is observed in the place of a low object; a hidden object stays, for any time. Only the robot's own motion ages it,
because it makes the place uncertain. All else is UNSEEN.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from robot_stack.core.geometry import Pose2, wrap_angle
from robot_stack.core.pose_history import StepLimit
from robot_stack.core.robot import Footprint, Robot
from robot_stack.perception.params import MovingObjectParams, SpaceParams
from robot_stack.perception.space import kernels
from robot_stack.perception.space.kernels import OCCUPIED, UNSEEN, Cells, Float, Floats, Layers, Rays, Where
from robot_stack.perception.space.rolling import rolled
from robot_stack.perception.space.view import View

# Contents of a layer where nothing is known; of the others, -inf.
_EMPTY: dict[str, Any] = {
    **{"state": UNSEEN, "passes": np.uint8(0), "found": np.False_},
    **dict.fromkeys(("last", "thing_m", "under_m", "ray_m"), np.float32(0.0)),
}
_MOST_POINTS = 8000
_STEP_S = 0.05
_STANDS_M = 0.02
_TINY = 1e-9
_MOST_VANISHED = 200
_MOVED_M = 1.0  # 2 m/s in the 0.5 s until the place that a body has left is freed
_HIDDEN_MPS = 0.5  # assumed where only the way counts
_HIDDEN_M = 1.6  # before an attached chair, an object 0.25 m high is hidden for 1.5 m


@dataclass(frozen=True, slots=True)
class SpaceGrid:
    """state: (rows, columns) -1 unseen, 0 free, 100 occupied, row 0 at the lowest y. corner_m: lower left, odom.
    hit_s: (rows, columns) time of the last return, -inf without one, as where a body may be that got hidden.
    since_s: (rows, columns) when it became occupied.
    """

    state: Cells
    corner_m: tuple[float, float]
    cell_m: float
    hit_s: Floats
    since_s: Floats


class Space:
    """Call ``observe`` for every view of every sensor in the order of arrival. before_s and stamps: as the views'."""

    def __init__(self, params: SpaceParams, robot: Robot) -> None:
        self._params, self._robot = params, robot
        fastest = robot.empty.max_speed_mps, robot.empty.max_yaw_rate_radps
        self._steps = StepLimit(*fastest, params.jump_m, params.jump_rad)
        count = round(params.size_m / params.cell_m)
        self._corner = np.zeros(2, np.int64)
        self._layers = Layers(
            *(
                np.full((count, count, 3) if name == "last" else (count, count), _EMPTY.get(name, -math.inf))
                for name in Layers._fields
            )
        )
        self._limits = np.array(
            [
                params.passes,
                params.top_margin_m,
                params.free_below_m,
                max(params.free_below_m, robot.lidar_xyz_m[2]),
                params.memory_m,
                params.low_m,
            ]
        )
        self._pose: Pose2 | None = None
        self._newest_s = -math.inf
        self._travel_m = 0.0
        self._stands_at: Pose2 | None = None
        self._stands_since_s = -math.inf
        self._chair = False
        self._points = np.empty((_MOST_POINTS, 3), np.float32)
        self._stack = np.empty(count * count, np.int64)

    def chair(self, attached: bool) -> None:
        """Sets the footprint in force. Cells occupied by the chair are freed once it is attached; the area hidden
        beneath it becomes unseen once it is gone."""
        if attached == self._chair:
            return
        self._chair = attached
        if self._pose is not None:
            margin_m = self._params.attach_margin_m if attached else 0.0
            rect = _rectangle(self._robot.footprint_with_chair, margin_m)
            kernels.fill(self._layers.state, *self._where(self._pose), rect, kernels.UNSEEN)

    def forget(self) -> None:
        """Makes all cells unseen."""
        self._layers.state[:] = UNSEEN
        for name, layer in self._layers._asdict().items():
            if name.endswith("_s"):  # a time: the clock may have been set back
                layer[:] = -math.inf
        self._pose, self._newest_s, self._stands_at = None, -math.inf, None

    def has_jumped(self, pose: Pose2, stamp_s: float) -> bool:
        """True if odometry has restarted: base_link is farther from the newest view's pose than the robot can move."""
        if self._pose is None:
            return False
        return not self._steps.allows(pose.relative_to(self._pose), stamp_s - self._newest_s)

    def observe(self, view: View, pose: Pose2) -> None:
        """Adds a view of a sensor; base_link was at ``pose`` at its stamp.

        A view slightly older than another sensor's newest one counts as of that time. One older by more than
        ``fade_s`` comes from a clock that was set back: all cells become unseen.
        """
        if view.stamp_s < self._newest_s - self._params.fade_s:
            self.forget()
        if view.stamp_s >= self._newest_s:
            self._move_to(pose, view.stamp_s)
            self._newest_s = view.stamp_s
        now_s = self._newest_s
        footprint = self._robot.footprint_with_chair if self._chair else self._robot.footprint
        where, own = self._where(pose), _rectangle(footprint, 0.0)
        rays = Rays(np.array(view.origin_m, np.float64), view.up, view.ground_m, view.passed_m, view.bare)
        p, layers = self._params, self._layers
        hits = np.ascontiguousarray(view.hits, np.float32)
        near_cells = round(p.thing_m / p.cell_m)
        kernels.mark(layers, where, rays, hits, own, near_cells, now_s, self._travel_m)
        kernels.hold(layers, where, view.specks, now_s)
        kernels.look(layers, where, rays, own, self._limits, 0.5 * p.fade_s, now_s, self._travel_m)
        kernels.fade(layers, round(p.enter_m / p.cell_m), p.fade_s, now_s, self._stack)

    def remembered(self, pose: Pose2, before_s: float) -> Float:
        """(n, 3) base_link at ``pose``: occupied cells with the last hit before ``before_s``; z above ground."""
        count = kernels.remembered(self._layers, self._where(pose), before_s, self._points)
        return self._points[:count].copy()

    def appeared(self, view: View, pose: Pose2) -> Floats:
        """(n, 5) of each newly occupied cell without an older obstacle right beside it, the mean return:
        x, y in odom, z, 1 if it was free and 0 if unseen, number of returns. Call ``observe`` first."""
        return self._appeared(view, pose, self._newest_s - self._params.moving_objects.new_s)

    def appeared_while_standing(self, view: View, pose: Pose2, slow: MovingObjectParams) -> Floats:
        """As ``appeared``, since the robot stands within 2 cm, a turn counting by ``lever_m``; at most ``new_s`` ago.

        Nothing before it has stood for ``follow_s``: while it moves, edges that come into view creep like slow bodies.
        """
        since_s = self._stands_since_s
        if self._newest_s - since_s < slow.follow_s:
            return np.empty((0, 5))
        return self._appeared(view, pose, max(since_s, self._newest_s - slow.new_s))

    def _appeared(self, view: View, pose: Pose2, after_s: float) -> Floats:
        """after_s: cells occupied later are new."""
        p = self._params
        hits, out = np.ascontiguousarray(view.hits, np.float32), np.empty((len(view.hits), 5))
        apart = round(p.moving_objects.apart_m / p.cell_m)
        return out[: kernels.appeared(self._layers, self._where(pose), hits, apart, after_s, out)]

    def vanished(self, pose: Pose2) -> Floats:
        """(n, 3) x, y in odom and height: places before unobserved space in which the last view lost an object that did
        not go on in view. It is in that space, however slow it was. Call ``observe`` first."""
        p, out = self._params, np.empty((_MOST_VANISHED, 3))
        count = kernels.vanished(
            self._layers,
            self._where(pose),
            self._beside(),
            self._limits,
            round(p.moving_objects.apart_m / p.cell_m),
            round(p.enter_m / p.cell_m),
            round(_MOVED_M / p.cell_m),
            p.moving_objects.follow_s,
            p.moving_objects.new_s,
            0.5 * p.fade_s,
            self._newest_s,
            out,
        )
        return out[:count]

    def is_visible(self, x_m: float, y_m: float, top_m: float) -> bool:
        """True if rays at that place in odom are low enough to detect an object of height ``top_m``, and a person."""
        return self._is_passed(x_m, y_m, self._shows_m(top_m))

    def is_visible_upright(self, x_m: float, y_m: float, top_m: float) -> bool:
        """As ``is_visible``, for an object that does not bend down: a tall one is detected by higher rays as well."""
        return self._is_passed(x_m, y_m, top_m - self._params.top_margin_m)

    def _is_passed(self, x_m: float, y_m: float, height_m: float) -> bool:
        """True if the lowest recent rays at that place in odom are no higher than ``height_m``."""
        cell_m, count = self._params.cell_m, len(self._layers.state)
        column, row = math.floor(x_m / cell_m) - self._corner[0], math.floor(y_m / cell_m) - self._corner[1]
        inside = 0 <= row < count and 0 <= column < count
        if not inside or self._layers.ray_s[row, column] < self._newest_s - 0.5 * self._params.fade_s:
            return False
        return bool(self._layers.ray_m[row, column] <= height_m)

    def mark_slow_hidden_body(self, body: Floats, vx_mps: float, vy_mps: float, pose: Pose2) -> None:
        """As ``mark_hidden_body``, and, if it approaches, also straight towards the footprint.

        The visible rest of a slow body that gets hidden bends its course by up to 20 deg."""
        self.mark_hidden_body(body, vx_mps, vy_mps, pose)
        towards = self._towards(body, pose)
        if towards @ (vx_mps, vy_mps) > 0.0:
            to_x, to_y = math.hypot(vx_mps, vy_mps) * towards
            self.mark_hidden_body(body, float(to_x), float(to_y), pose)

    def stands_in_view(self, body: Floats, vx_mps: float, vy_mps: float) -> bool:
        """True if an object, last observed in motion as ``body``, (n, 3) x, y in odom, z, has stopped there.

        At least half of it still returns, and rays below its top pass ahead of it: none of it is hidden. Nothing else
        returns there, because static objects within ``apart_m`` are no part of a body."""
        p, top_m = self._params, float(body[:, 2].max())
        around = round(p.moving_objects.apart_m / p.cell_m)
        cells = np.floor(body[:, [1, 0]] / p.cell_m).astype(np.int64) - self._corner[::-1]
        fresh = (self._layers.state == OCCUPIED) & (self._layers.hit_s >= self._newest_s - 0.5 * p.fade_s)
        returned = [
            bool(fresh[max(r - around, 0) : r + around + 1, max(c - around, 0) : c + around + 1].any())
            for r, c in cells.tolist()
        ]
        if np.mean(returned) < 0.5:
            return False
        course = np.array([vx_mps, vy_mps]) / max(math.hypot(vx_mps, vy_mps), _TINY)
        front = body[np.argmax(body[:, :2] @ course), :2]
        ahead = [
            front + away_m * course
            for away_m in np.arange(2.0 * p.cell_m, p.moving_objects.link_m + p.enter_m, p.cell_m)
        ]
        return all(self.is_visible_upright(float(x), float(y), top_m) for x, y in ahead)

    def mark_vanished(self, places: Floats, pose: Pose2) -> None:
        """Marks as occupied where the straight way from each place, a row of ``vanished``, to the footprint ends."""
        for place in places:
            to_x, to_y = _HIDDEN_MPS * self._towards(place[None], pose)
            if to_x or to_y:
                self.mark_hidden_body(place[None], float(to_x), float(to_y), pose)

    def _towards(self, body: Floats, pose: Pose2) -> Floats:
        """(2,) odom: unit vector from the body's middle to the footprint in force, 0 beside it."""
        rear, front, half = self._beside()
        x, y, c, s = _array(pose)
        dx, dy = body[:, 0].mean() - x, body[:, 1].mean() - y
        u, v = c * dx + s * dy, c * dy - s * dx
        to_u, to_v = min(max(u, rear), front) - u, min(max(v, -half), half) - v
        return np.array([c * to_u - s * to_v, s * to_u + c * to_v]) / max(math.hypot(to_u, to_v), _TINY)

    def mark_hidden_body(self, body: Floats, vx_mps: float, vy_mps: float, pose: Pose2) -> None:
        """Marks where a moving object, last observed as ``body``, (n, 3) x, y in odom, z, may have gone as occupied.

        That is along its course, up to the robot, or to where it would be observed again."""
        p, (rear, front, half) = self._params, self._beside()
        x, y, c, s = _array(pose)
        at, top_m, hidden = body, float(body[:, 2].max()), False
        middle = body[:, :2].mean(axis=0)
        end_s, speed_mps = p.moving_objects.coast_s, math.hypot(vx_mps, vy_mps)
        if vx_mps * (x - middle[0]) + vy_mps * (y - middle[1]) > 0.0:  # a slow one approaches for longer
            end_s = max(end_s, _HIDDEN_M / speed_mps)
        step_s = max(_STEP_S, p.cell_m / max(speed_mps, _TINY))
        for after_s in np.arange(step_s, end_s + step_s, step_s):
            on = body + np.array([after_s * vx_mps, after_s * vy_mps, 0.0])
            dx, dy = on[:, 0] - x, on[:, 1] - y
            u, v = c * dx + s * dy, c * dy - s * dx
            if ((u >= rear) & (u <= front) & (np.abs(v) <= half)).any():
                break
            if not self.is_visible(middle[0] + after_s * vx_mps, middle[1] + after_s * vy_mps, top_m):
                at, hidden = on, True
            elif hidden:
                break
        shows_m = self._shows_m(top_m)
        at = np.array(at, np.float64)
        # Only a ray that would detect the object here clears it: a tall one, a person, may bend down.
        at[:, 2] = np.minimum(at[:, 2], shows_m + p.top_margin_m)
        kernels.stand(
            self._layers,
            self._where(pose),
            at,
            shows_m,
            self._newest_s - 0.5 * p.fade_s,
            self._newest_s,
            self._travel_m,
        )

    def _beside(self) -> Floats:
        """Rear, front and half width of the footprint in force and ``beside_m`` around it, base_link, m."""
        footprint = self._robot.footprint_with_chair if self._chair else self._robot.footprint
        return _rectangle(footprint, self._params.moving_objects.beside_m)

    def _shows_m(self, top_m: float) -> float:
        """Height below which a ray detects an object that high: lower than its top, and than the LiDAR."""
        return min(top_m - self._params.top_margin_m, float(self._limits[kernels.WATCHED_BELOW_M]))

    def frontier(self, pose: Pose2) -> Float:
        """(n, 3) base_link at ``pose``: where the observed and stored space ends, z 0."""
        count = kernels.frontier(self._layers, self._where(pose), 0.5 * self._params.size_m, self._points)
        return self._points[:count].copy()

    def grid(self) -> SpaceGrid:
        """The present grid; the arrays change with the next view."""
        x, y = (float(self._corner[axis] * self._params.cell_m) for axis in (0, 1))
        returned_s = np.where(self._layers.hit_s == self._layers.stood_s, -math.inf, self._layers.hit_s)
        return SpaceGrid(self._layers.state, (x, y), self._params.cell_m, returned_s, self._layers.since_s)

    def _move_to(self, pose: Pose2, stamp_s: float) -> None:
        before = self._pose
        if before is not None:
            self._travel_m += self._way_m(before, pose)
        if before is None or self._stands_at is None or self._way_m(self._stands_at, pose) > _STANDS_M:
            self._stands_at, self._stands_since_s = pose, stamp_s
        self._pose = pose
        self._centre_on(pose)

    def _way_m(self, begin: Pose2, end: Pose2) -> float:
        return end.distance_to(begin) + abs(wrap_angle(end.yaw - begin.yaw)) * self._params.lever_m

    def _centre_on(self, pose: Pose2) -> None:
        """Rolls so that ``pose`` is in the middle. Cells that leave the grid are dropped, new cells are unseen."""
        half, cell_m = len(self._layers.state) // 2, self._params.cell_m
        corner = np.array([math.floor(pose.x / cell_m) - half, math.floor(pose.y / cell_m) - half], np.int64)
        columns, rows = (int(step) for step in corner - self._corner)
        self._corner = corner
        if rows or columns:
            empty = (float(_EMPTY.get(name, -math.inf)) for name in Layers._fields)
            pairs = zip(self._layers, empty, strict=True)
            self._layers = Layers(*(rolled(layer, rows, columns, value) for layer, value in pairs))

    def _where(self, pose: Pose2) -> Where:
        return Where(self._corner, self._params.cell_m, _array(pose))


def _array(pose: Pose2) -> Floats:
    return np.array([pose.x, pose.y, math.cos(pose.yaw), math.sin(pose.yaw)])


def _rectangle(footprint: Footprint, margin_m: float) -> Floats:
    half = 0.5 * footprint.width_m
    return np.array([footprint.rear_m - margin_m, footprint.front_m + margin_m, half + margin_m])

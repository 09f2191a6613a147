"""One range sensor's points in base_link and their ground: all that depends on its mounting."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.point_cloud import Points
from robot_stack.core.robot import Mast, Robot
from robot_stack.perception import ground
from robot_stack.perception.crop import UPRIGHT, beside_mast, boxes, crop
from robot_stack.perception.deskew import LEVEL, Attitude, Motion, deskew
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.polar import Sorted, make_grid, sort_points
from robot_stack.perception.space.view import SweepViews, direction_of

Float = NDArray[np.float32]
Floats = NDArray[np.float64]
_DIRECTIONS = 180
_SAMPLE = 3000  # points of a sweep, whose times are evaluated


@dataclass(frozen=True, slots=True)
class Segmented:
    """xyz: (n, 3) base_link; labels: (n,) of ``cells``; height_m: (n,) above the local ground. sensor_m: levelled.

    tilt: by how much base_link's x and y axes rise.
    """

    xyz: Float
    labels: NDArray[np.uint8]
    height_m: Float
    profile: ground.Profile
    points: Sorted
    sensor_m: tuple[float, float, float]
    tilt: tuple[float, float]


class SensorView:
    """name: of the range sensor. range_m: least and greatest used range. mast: the mast in its view.

    mount: (3,) base_link. turned: (3, 3) from the axes of its frame to base_link's, None if they are the same. cut:
    with and without a chair, (k, 6) boxes of the robot itself, the chair last.
    """

    def __init__(
        self,
        robot: Robot,
        params: PerceptionParams,
        name: str,
        range_m: tuple[float, float],
        mast: Mast | None = None,
    ) -> None:
        self._params = params
        self._sensor = sensor = robot.range_sensors[name]
        self.grid = make_grid(params.ground, range_m[1])
        self.mount = np.array(sensor.xyz_m, dtype=np.float32)
        self.xy_m = (float(self.mount[0]), float(self.mount[1]))
        turned = robot.sensor_frame(name).astype(np.float32)
        self.turned = None if (turned == np.eye(3)).all() else turned
        self._border = ground.wheel_border(robot, self.grid, self.xy_m)
        self._reach = ground.reach_of(sensor, params.ground, params.free_space, range_m[1])
        self.cut = {chair: boxes(robot, params.crop, chair) for chair in (False, True)}
        self._range_m, self._mast = range_m, mast
        self._margin_rad = params.crop.mast_columns * math.radians(sensor.span_deg) / sensor.columns

    def views(self, reach_m: float, floor_m: float) -> SweepViews:
        """Makes views of its sweeps, with rays up to ``reach_m`` and ground up to ``floor_m``."""
        up, slope_deg = self._sensor.highest_slope(), self._params.ground.max_slope_deg
        return SweepViews(self.grid, reach_m, floor_m, self._reach.ring_spacing_rad, slope_deg, up)

    def points(
        self, points: Points, stamp_s: float, motion: Motion, chair: bool, lean: Float = UPRIGHT
    ) -> tuple[Float, int]:
        """Cropped and de-skewed: (n, 3) base_link at the stamp, and how many points were not finite.

        lean: of an attached chair, see ``UPRIGHT``."""
        xyz, times, broken = crop(
            points, self.mount, self.cut[chair], self._range_m, self.turned, lean if chair else UPRIGHT
        )
        if self._mast is not None:
            kept = ~beside_mast(xyz, self.xy_m, self._mast, self._margin_rad)
            xyz, times = xyz[kept], times[kept]
        oldest_s = max(float(times.min()), -self._params.deskew.longest_s) if len(times) else 0.0
        steps = motion.steps(stamp_s, oldest_s)
        return deskew(xyz, times, steps, self._params.deskew.step_s, out=xyz), broken

    def looked_s(self, points: Points) -> Floats:
        """Mean times of a sweep's points by direction, as in ``View``."""
        some = points[:: len(points) // _SAMPLE + 1]
        xyz = np.stack([some["x"], some["y"], some["z"]], axis=1)
        x, y, _ = (xyz if self.turned is None else xyz @ self.turned.T).T
        known = np.isfinite(x + y)
        sectors = direction_of(x[known], y[known], _DIRECTIONS)
        count = np.bincount(sectors, minlength=_DIRECTIONS)
        total = np.bincount(sectors, some["time"][known], minlength=_DIRECTIONS)
        found = np.flatnonzero(count)
        if not len(found):
            return np.zeros(_DIRECTIONS)
        return np.interp(np.arange(_DIRECTIONS), found, total[found] / count[found], period=_DIRECTIONS)

    def segment(self, xyz: Float, attitude: Attitude | None = None) -> Segmented:
        """Ground and other points. xyz: (n, 3) base_link; attitude None: the robot's own plane is assumed level."""
        params, level = self._params.ground, (attitude or LEVEL).matrix()
        x, y, z = (float(value) for value in level @ self.mount)
        points = sort_points(xyz, level.astype(np.float32), (x, y), self.grid, params.low_band_m, params.outlier_gap_m)
        start = ground.seeds(self._border, level, (x, y))
        profile = ground.follow(points, self.grid, start, z, params, self._params.free_space, self._reach)
        labels, height = ground.classify(points, profile, z, params, self._reach)
        return Segmented(xyz, labels, height, profile, points, (x, y, z), (float(level[2, 0]), float(level[2, 1])))

"""A pane of glass before and beside the robot: how much of it is published, and which mirror images are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.config import load, validate
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.robot import load_robot
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from robot_stack.perception.warm_up import warm_up
from sim.camera.motion import Track
from sim.lidar.params import LidarParams, load_lidar_params
from sim.lidar.scene import build_scene
from sim.lidar.sensor import Lidar
from sim.lidar.views import moving
from sim.params import load_sim_params
from sim.worldfile import WorldFile
from tests.benchmarks.support.framework import Result

Float = NDArray[np.float32]
_HALF_S, _HALVES, _SETTLE = 0.05, 16, 8
_FACE_M, _HALF_WIDTH_M, _ROOM_M = 0.0, 3.0, 4.0  # the pane lies along y at this x; the room is behind it
DIRT = (0.01, 0.001, 0.0001)
_DISTANCES_M = (1.5, 2.0, 3.0, 5.0)
_CELL_M, _WITHIN_M, _APART_M = 0.2, 0.15, 0.3
_CORRIDOR_M = 0.4
_SPEED_MPS, _FROM_M, _TO_M = 1.0, 5.0, 1.0
_COURSES_DEG = (0, 60)


@dataclass(frozen=True, slots=True)
class Window:
    """A shop window, 6 m wide. lit: a wall stands 4 m behind it; otherwise only the ground behind it returns points."""

    lit: bool
    dirt: float

    def world(self) -> WorldFile:
        """The street is at x < 0, with a pole, a parked car and a house opposite."""
        walls = [_box("pane", 0.01, 0.0, 0.02, 2.0 * _HALF_WIDTH_M, 2.5), _box("across", -12.0, 0.0, 0.5, 30.0, 6.0)]
        walls += [_box("room", _ROOM_M + 0.1, 0.0, 0.2, 12.0, 3.0)] if self.lit else []
        floor = {"min_x_m": -25, "max_x_m": 25, "min_y_m": -25, "max_y_m": 25}
        return validate(
            WorldFile,
            {
                "note": "A window on a street.",
                "friction": 0.8,
                "floor": floor,
                "start": {"x_m": -3, "y_m": 0, "yaw_deg": 0},
                "walls": walls,
                "boxes": [_box("car", -4.0, 4.5, 4.4, 1.8, 1.5)],
                "cylinders": [{"name": "pole", "x_m": -1.0, "y_m": -2.2, "radius_m": 0.06, "height_m": 3.0}],
                "glass": ["pane"],
            },
            "glass",
        )

    def params(self) -> LidarParams:
        data = load_lidar_params().model_dump()
        return LidarParams.model_validate({**data, "glass": {**data["glass"], "dirt": self.dirt}})


def run(seeds: int = 3, seed: int = 2101) -> Result:
    """seeds: sensors for each figure, from ``seed`` on."""
    warm_up()
    drawn = range(seed, seed + seeds)
    figures: dict[str, float] = {}
    for lit in (True, False):
        for dirt in DIRT:
            name = f"{'lit' if lit else 'dark'}_{1e4 * dirt:.0f}"
            looks = [standing(Window(lit, dirt), far_m, drawn) for far_m in _DISTANCES_M]
            figures |= {
                f"missed_{name}_{far_m:g}m_pct": missed
                for far_m, (missed, _, _) in zip(_DISTANCES_M, looks, strict=True)
            }
            figures[f"images_{name}"] = max(behind for _, behind, _ in looks)
            figures[f"phantoms_before_{name}"] = max(before for _, _, before in looks)
            for course in _COURSES_DEG:
                figures[f"hidden_{name}_{course}deg_m"] = approached(Window(lit, dirt), drawn, course)
    return Result(figures, {"rules": _rules()})


def standing(window: Window, far_m: float, seeds: Sequence[int]) -> tuple[float, float, float]:
    """At distance far_m: % of the pane's cells that a cloud misses; phantom points behind and before the pane."""
    missed, behind, before = [], [], []
    for seed in seeds:
        for shown in clouds(window, seed, [far_m] * _HALVES)[_SETTLE:]:
            missed.append(missed_pct(shown))
            stray = _from_nothing(shown, window)
            behind.append(int((shown[stray, 0] > _FACE_M).sum()))
            before.append(int((shown[stray, 0] <= _FACE_M).sum()))
    return float(np.mean(missed)), float(np.mean(behind)), float(np.mean(before))


def approached(window: Window, seeds: Sequence[int], course_deg: float = 0.0) -> float:
    """The least distance from base_link to the pane at which a cloud lacks it in the robot's way; 0 if none does."""
    steps = round((_FROM_M - _TO_M) / (_SPEED_MPS * _HALF_S))
    to_go = [_FROM_M - _SPEED_MPS * _HALF_S * step for step in range(steps + 1)]
    course = math.radians(course_deg)
    hidden = [0.0]
    for seed in seeds:
        for far_m, shown in zip(to_go, clouds(window, seed, to_go, course), strict=True):
            aside = shown[:, 1] * math.cos(course) - shown[:, 0] * math.sin(course)
            if not ((np.abs(shown[:, 0]) < _WITHIN_M) & (np.abs(aside) < _CORRIDOR_M)).any():
                hidden.append(far_m)
    return min(hidden[1:], default=0.0)


def missed_pct(shown: Float) -> float:
    """Missed share of the pane's middle 4 m, in cells of 0.2 m. shown: (n, 3), map."""
    at_pane = shown[np.abs(shown[:, 0] - _FACE_M) < _WITHIN_M, 1]
    cells = round(2.0 * (_HALF_WIDTH_M - 1.0) / _CELL_M)
    found = np.unique(np.floor((at_pane + _HALF_WIDTH_M - 1.0) / _CELL_M).astype(int))
    return 100.0 * float(1.0 - ((found >= 0) & (found < cells)).sum() / cells)


def _from_nothing(shown: Float, window: Window) -> NDArray[np.bool_]:
    """(n,) True for points (n, 3), map, farther than 0.3 m in plan from every solid."""
    x, y = shown[:, 0], shown[:, 1]
    near = np.zeros(len(shown), np.bool_)
    file = window.world()
    for solid in file.solids():
        out_x = np.maximum(np.abs(x - solid.x_m) - 0.5 * solid.length_m, 0.0)
        out_y = np.maximum(np.abs(y - solid.y_m) - 0.5 * solid.width_m, 0.0)
        near |= np.hypot(out_x, out_y) < _APART_M
    for pole in file.cylinders:
        near |= np.hypot(x - pole.x_m, y - pole.y_m) - pole.radius_m < _APART_M
    return ~near


def clouds(window: Window, seed: int, to_go_m: Sequence[float], course: float = 0.0) -> list[Float]:
    """(n, 3) map: points published after each half sweep, at the given distances to the pane and course (rad)."""
    params = window.params()
    lidar = Lidar(build_scene(window.world(), params, load_sim_params().wheelchair), params, load_robot(), seed)
    pipeline, out = Pipeline(load_robot(), load(PerceptionParams, "perception_pipeline")), []
    twist = Twist2((to_go_m[0] - to_go_m[1]) / _HALF_S, 0.0, 0.0)
    c, s = math.cos(course), math.sin(course)
    for step, to_go in enumerate(to_go_m):
        stamp_s, base = _HALF_S * step, np.eye(4)
        base[:2, :2], base[:2, 3] = [[c, -s], [s, c]], (-to_go * c, -to_go * s)
        track = moving(base, twist, _HALF_S)
        pipeline.motion.on_odometry(stamp_s, Pose2(base[0, 3], base[1, 3], course), twist)
        sweep = lidar.half_sweep(Track(track.times_s + stamp_s, track.poses), stamp_s, step % 2)
        shown = pipeline.scene(sweep.points, stamp_s).obstacles
        out.append((shown @ base[:3, :3].T + base[:3, 3]).astype(np.float32))
    return out


def _box(name: str, x_m: float, y_m: float, length_m: float, width_m: float, height_m: float) -> dict[str, object]:
    size = {"length_m": length_m, "width_m": width_m, "height_m": height_m}
    return {"name": name, "x_m": x_m, "y_m": y_m, **size}


def _rules() -> dict[str, object]:
    return {
        "window": "6 m by 2.5 m, across the robot's way; lit: a wall 4 m behind it, dark: nothing; the number is the "
        "reflectivity of the dirt on it in ten-thousandths; a car, a pole and a house on the street",
        "missed": f"of {_CELL_M} m cells of its middle 4 m, no point within {_WITHIN_M} m, standing so far off",
        "images, phantoms_before": f"points of a cloud farther than {_APART_M} m in plan from anything, behind the "
        "pane and before it; mean of a place, the worst place",
        "hidden": f"driving towards it at {_SPEED_MPS} m/s from {_FROM_M} to {_TO_M} m, so far off its normal: least "
        f"distance at which a cloud showed nothing of it within {_CORRIDOR_M} m of the robot's middle; 0: all did",
    }

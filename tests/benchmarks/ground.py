"""Ground removal on labelled sweeps with ramps, kerbs and people, beside Patchwork++ on the same points."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.config import load
from robot_stack.core.robot import load_robot
from robot_stack.perception.cells import GROUND
from robot_stack.perception.crop import boxes, crop
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from robot_stack.perception.warm_up import warm_up
from sim.nodes.imu_driver import ImuDriverParams
from tests.benchmarks.support.framework import Aim, Result
from tests.benchmarks.support.ground_kerbs import kerb_ranges
from tests.benchmarks.support.ground_pictures import draw
from tests.benchmarks.support.ground_real import real_agreement
from tests.benchmarks.support.ground_scenes import FOOT_M, Shot, shots
from tests.benchmarks.support.patchwork import Patchwork

AIMS = {"ms_p50": Aim("<", 5.0), "f1": Aim(">=", 0.97), "f1_minus_patchworkpp": Aim(">=", 0.0)}
Float = NDArray[np.float32]
# Linear algebra threads of the sweep generation spin for some 30 ms and would count as process time.
_QUIET_S = 0.1
Mask = NDArray[np.bool_]


def run(repeats: int = 5, kerb_seeds: int = 5, seed: int = 1, pictures: str = "results/ground") -> Result:
    """repeats: timed runs per sweep; kerb_seeds: sweeps per kerb and distance; pictures: folder, empty for none."""
    robot, params = load_robot(), load(PerceptionParams, "perception_pipeline")
    pipeline, peer = Pipeline(robot, params), Patchwork(robot.lidar_xyz_m[2])
    warm_up()
    mount = np.array(robot.lidar_xyz_m, np.float32)
    sigma = load(ImuDriverParams, "imu_driver").attitude_sigma_rad
    ours, theirs = _Score(), _Score()
    places: dict[str, dict[str, float]] = {}
    for shot in shots(robot, sigma, seed):
        xyz, rows = _cropped(shot, pipeline, params, mount)
        seen = pipeline.segment(xyz, shot.attitude)
        truth, counts = shot.ground[rows], shot.scored[rows]
        mine = ours.add(seen.labels == GROUND, truth, counts)
        ours.time(partial(pipeline.segment, xyz, shot.attitude), repeats)
        other = theirs.add(peer.ground(xyz - mount), truth, counts)
        theirs.time(partial(peer.ground, xyz - mount), repeats)
        places[shot.name] = {"f1": round(mine, 4), "patchworkpp_f1": round(other, 4)}
        if pictures:
            draw(Path(pictures), shot, xyz, seen, truth, counts)
    figures = {
        **ours.figures(""),
        **theirs.figures("patchworkpp_"),
        "f1_minus_patchworkpp": ours.f1() - theirs.f1(),
    }
    ranges = kerb_ranges(pipeline, kerb_seeds, seed)
    real = real_agreement(params, robot)
    figures |= {f"{name}_seen_to_m": value for name, value in ranges.items()} | real.figures
    return Result(figures, {"places": places, "rules": _rules(), "real_sweeps": real.note, "peer": peer.note})


class _Score:
    def __init__(self) -> None:
        self.hits = self.claimed = self.true = 0
        self.ms: list[float] = []
        self.points: list[int] = []

    def add(self, found: Mask, truth: Mask, counts: Mask) -> float:
        """F1 of this sweep alone."""
        hits, claimed, true = (int((mask & counts).sum()) for mask in (found & truth, found, truth))
        self.hits, self.claimed, self.true = self.hits + hits, self.claimed + claimed, self.true + true
        self.points.append(len(found))
        return 2.0 * hits / max(claimed + true, 1)

    def time(self, work: Callable[[], object], repeats: int) -> None:
        time.sleep(_QUIET_S)
        for _ in range(repeats):
            began_s = time.process_time()
            work()
            self.ms.append(1e3 * (time.process_time() - began_s))

    def f1(self) -> float:
        return 2.0 * self.hits / max(self.claimed + self.true, 1)

    def figures(self, prefix: str) -> dict[str, float]:
        return {
            f"{prefix}ms_p50": float(np.median(self.ms)),
            f"{prefix}ms_per_150k_points": float(np.median(self.ms)) * 150e3 / float(np.median(self.points)),
            f"{prefix}f1": self.f1(),
            f"{prefix}precision": self.hits / max(self.claimed, 1),
            f"{prefix}recall": self.hits / max(self.true, 1),
        }


def _cropped(shot: Shot, pipeline: Pipeline, params: PerceptionParams, mount: Float) -> tuple[Float, NDArray[np.int64]]:
    """(m, 3) points in base_link without the robot, and the mask of the sweep's rows kept."""
    numbered = shot.points.copy()
    numbered["time"] = np.arange(len(numbered))
    robot = load_robot()
    range_m = (params.crop.range_min_m, params.crop.range_max_m)
    xyz, rows, _ = crop(numbered, mount, boxes(robot, params.crop, chair=False), range_m)
    return xyz, rows.astype(np.int64)


def _rules() -> dict[str, object]:
    return {
        "ground": "ground and the upper faces of ramps; kerbs, also their tops, are not",
        "left out": f"points of solids less than {FOOT_M} m above the ground",
        "ms": "process time of one full sweep, one thread, standing robot; attitude as wrong as the inertial unit's",
        "seen to": "greatest distance of the kerb from base_link up to which 80 % of its front has obstacle points",
    }

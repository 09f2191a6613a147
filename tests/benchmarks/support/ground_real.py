"""Ground removal on two real sweeps, if they are stored beside the project."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robot_stack.contract import frames
from robot_stack.core.robot import Robot
from robot_stack.perception.cells import GROUND
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from tests.benchmarks.support.framework import ROOT
from tests.benchmarks.support.patchwork import Patchwork

FOLDER = ROOT.parent / "shared" / "data" / "lidar"
SENSOR_HEIGHT_M = 1.73
_NEAR_M = 30.0


@dataclass(frozen=True, slots=True)
class Real:
    figures: dict[str, float]
    note: str


def real_agreement(params: PerceptionParams, robot: Robot, folder: Path = FOLDER) -> Real:
    """Share of points within 30 m with equal ground labels from both methods. There is no ground truth."""
    files = sorted(folder.glob("scan_*.bin"))
    if not files:
        return Real({}, f"none in {folder}: agreement not measured")
    lidar = robot.range_sensors[frames.LIDAR].model_copy(update={"xyz_m": (0.0, 0.0, SENSOR_HEIGHT_M)})
    car = robot.model_copy(update={"range_sensors": {frames.LIDAR: lidar}})
    pipeline, peer = Pipeline(car, params), Patchwork(SENSOR_HEIGHT_M)
    shares = []
    for file in files:
        xyz = np.fromfile(file, np.float32).reshape(-1, 4)[:, :3]
        xyz = np.ascontiguousarray(xyz[np.hypot(xyz[:, 0], xyz[:, 1]) < _NEAR_M])
        lifted = xyz + np.array([0.0, 0.0, SENSOR_HEIGHT_M], np.float32)
        mine = pipeline.segment(lifted).labels == GROUND
        shares.append(100.0 * float((mine == peer.ground(xyz)).mean()))
    return Real({"real_agreement_pct": min(shares)}, f"{len(files)} sweeps within {_NEAR_M:.0f} m, the worse one")

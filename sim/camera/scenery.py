"""Objects behind the boards, as boxes and cylinders for the backdrop: the world's solids, the chair."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robot_stack.core.docks import Docks
from sim.plant.terrain import Solid

Array = NDArray[np.float64]
BOX, CYLINDER = 0.0, 1.0
PLAIN, WINDOWS, BLOTCHED = 0.0, 1.0, 2.0
# Row of a shape: kind, three half sizes (radius, radius, half height), reflectance, texture.
SHAPE_SIZE = 6

# Reflectances are those of the materials; a panelled house front has rows of windows, which look like squares.
_LOOK = {
    "kerb": (0.55, PLAIN),
    "wall": (0.50, WINDOWS),
    "box": (0.33, BLOTCHED),
    "cylinder": (0.22, BLOTCHED),
    "ramp": (0.45, PLAIN),
    "station": (0.28, PLAIN),
    "patch": (0.24, PLAIN),
}
# The chair in its dock's frame: (centre, half sizes, reflectance). Low rails beside the board, seat and back behind it.
_CHAIR = (
    ((0.02, 0.0, 0.45), (0.012, 0.30, 0.26), 0.18),
    ((-0.20, 0.33, 0.19), (0.25, 0.015, 0.015), 0.12),
    ((-0.20, -0.33, 0.19), (0.25, 0.015, 0.015), 0.12),
    ((0.30, 0.0, 0.50), (0.24, 0.24, 0.03), 0.10),
    ((0.10, 0.0, 0.80), (0.02, 0.24, 0.22), 0.10),
    ((0.30, 0.31, 0.30), (0.29, 0.02, 0.29), 0.08),
    ((0.30, -0.31, 0.30), (0.29, 0.02, 0.29), 0.08),
)


@dataclass(frozen=True, slots=True)
class Parts:
    """Solids in one frame. poses: (n, 4, 4); shapes: (n, SHAPE_SIZE)."""

    poses: Array = field(default_factory=lambda: np.zeros((0, 4, 4)))
    shapes: Array = field(default_factory=lambda: np.zeros((0, SHAPE_SIZE)))


@dataclass(frozen=True, slots=True)
class Scenery:
    """still: in map. carried: by dock id, in the dock's frame."""

    still: Parts = field(default_factory=Parts)
    carried: Mapping[str, Parts] = field(default_factory=dict)

    def placed(self, boards: Mapping[str, Array]) -> Parts:
        """Everything in map, with the docks at ``boards`` (4, 4 each)."""
        poses, shapes = [self.still.poses], [self.still.shapes]
        for name, parts in self.carried.items():
            if name in boards:
                poses.append(boards[name] @ parts.poses)
                shapes.append(parts.shapes)
        return Parts(np.concatenate(poses), np.concatenate(shapes))


def build_scenery(solids: Iterable[Solid], docks: Docks) -> Scenery:
    """The world's solids, stations among them, and a chair around every wheelchair's board."""
    carried = {name: _parts(_CHAIR, BLOTCHED) for name, dock in docks.docks.items() if dock.kind == "wheelchair"}
    poses, shapes = [], []
    for solid in solids:
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_euler("ZY", [solid.yaw_rad, solid.pitch_rad]).as_matrix()
        pose[:3, 3] = solid.centre_m
        poses.append(pose)
        box = solid.shape == "box"
        sizes = solid.size_m if box else (solid.size_m[0], solid.size_m[0], solid.size_m[1])
        shapes.append([BOX if box else CYLINDER, *sizes, *_LOOK[solid.kind]])
    still = Parts(np.array(poses), np.array(shapes, dtype=float)) if poses else Parts()
    return Scenery(still, carried)


def _parts(boxes: tuple[tuple[tuple[float, ...], tuple[float, ...], float], ...], texture: float) -> Parts:
    poses = np.tile(np.eye(4), (len(boxes), 1, 1))
    poses[:, :3, 3] = [centre for centre, _, _ in boxes]
    return Parts(poses, np.array([[BOX, *half, reflectance, texture] for _, half, reflectance in boxes]))

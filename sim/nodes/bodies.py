"""/sim/bodies as matrices, for the drivers of exteroceptive sensors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from robot_stack.contract import topics
from robot_stack.middleware.inputs import Input
from robot_stack.middleware.node import StackNode
from sim.camera.history import BASE
from sim.nodes.message_bytes import read_transforms

Array = NDArray[np.float64]


class Bodies:
    """Calls ``take`` with the stamp, s, and the poses in map of each sample, (4, 4) by frame id.

    Samples are taken as bytes: at 50 Hz, constructing Python objects would cost more than their use.
    """

    def __init__(self, node: StackNode, take: Callable[[float, dict[str, Array]], None]) -> None:
        self._node, self._take = node, take
        self.input: Input = node.subscribe(topics.SIM_BODIES, self._on_bytes, raw=True)

    def watch(self, silence_s: float) -> None:
        """Reports silent inputs."""
        if self.input.received and self.input.age_s() > silence_s:
            self._node.set_health(False, f"{topics.SIM_BODIES.name} has timed out")

    def _on_bytes(self, data: bytes) -> None:
        time_s, numbers = read_transforms(data)
        matrices = matrices_of(np.array(list(numbers.values())).reshape(-1, 7))
        if BASE not in numbers or not np.isfinite(matrices).all():
            self._node.set_health(False, f"{topics.SIM_BODIES.name} without {BASE}, or with poses that are not finite")
            return
        self._take(time_s, dict(zip(numbers, matrices, strict=True)))


def matrices_of(poses: Array) -> Array:
    """(n, 4, 4) of (n, 7) x y z m, quaternion x y z w; not finite for an invalid rotation."""
    q = poses[:, 3:]
    norm2 = np.einsum("ij,ij->i", q, q)
    scale = np.where(norm2 > 0.5, 2.0, np.nan) / np.maximum(norm2, 0.5)
    products = scale[:, None, None] * q[:, :, None] * q[:, None, :]
    xx, yy, zz = products[:, 0, 0], products[:, 1, 1], products[:, 2, 2]
    xy, xz, yz = products[:, 0, 1], products[:, 0, 2], products[:, 1, 2]
    wx, wy, wz = products[:, 3, 0], products[:, 3, 1], products[:, 3, 2]
    matrices = np.zeros((len(poses), 4, 4))
    matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 0, 2] = 1.0 - yy - zz, xy - wz, xz + wy
    matrices[:, 1, 0], matrices[:, 1, 1], matrices[:, 1, 2] = xy + wz, 1.0 - xx - zz, yz - wx
    matrices[:, 2, 0], matrices[:, 2, 1], matrices[:, 2, 2] = xz - wy, yz + wx, 1.0 - xx - yy
    matrices[:, :3, 3], matrices[:, 3, 3] = poses[:, :3], 1.0
    return matrices

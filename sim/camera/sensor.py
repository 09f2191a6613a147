"""The sensor: amplification, noise, quantization."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled

F32 = NDArray[np.float32]


@compiled
def expose(
    image: F32,
    gain: float,
    bank: F32,
    offsets: NDArray[np.int64],
    read_dn: float,
    shot_dn: float,
    out: NDArray[np.uint8],
) -> None:
    """Amplifies, adds noise and quantizes. bank: unit normal noise; offsets: (H,) where each row begins in it.

    The noise's variance is (gain read_dn)^2 + gain shot_dn level: shot noise.
    """
    read2 = np.float32((gain * read_dn) ** 2)
    shot = np.float32(gain * shot_dn)
    factor = np.float32(gain)
    for row in range(image.shape[0]):
        noise = bank[offsets[row] : offsets[row] + image.shape[1]]
        for column in range(image.shape[1]):
            level = factor * image[row, column]
            level += noise[column] * np.sqrt(read2 + shot * max(level, np.float32(0.0)))
            level = min(max(level, np.float32(0.0)), np.float32(255.0)) + np.float32(0.5)
            out[row, column] = np.uint8(min(level, np.float32(255.0)))

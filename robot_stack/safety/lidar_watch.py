"""Detects a frozen, replayed or covered LiDAR by a sample of the points of each sweep."""

from __future__ import annotations

import math
from collections import deque
from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

from robot_stack.safety.obstacle_params import LidarParams
from robot_stack.safety.timing import age_s

# A sweep equal to one of this many before it is a replayed one: 10 s of them.
_REMEMBERED = 100


class LidarWatch:
    """Age of the last valid sweep: a frozen, replayed or covered sensor counts as silent."""

    def __init__(self, params: LidarParams) -> None:
        self._params = params
        self._before: deque[bytes] = deque(maxlen=_REMEMBERED)
        self._at_s: float | None = None
        self.problem = "never received"

    def received(self, sample: NDArray[np.float32], of: int, now_s: float) -> None:
        """A sweep of ``of`` points, of which ``sample`` (m, 3) are checked: m, sensor frame."""
        digest = blake2b(np.ascontiguousarray(sample).tobytes(), digest_size=16).digest()
        self.problem = self._problem(sample, of, repeated=digest in self._before)
        self._before.append(digest)
        if not self.problem:
            self._at_s = now_s

    def refused(self, problem: str) -> None:
        """Handles a message that is no valid sweep."""
        self.problem = problem

    def age_s(self, now_s: float) -> float:
        return age_s(now_s, self._at_s)

    def _problem(self, sample: NDArray[np.float32], of: int, *, repeated: bool) -> str:
        p = self._params
        x, y, z = sample.T.astype(np.float64)
        ranges = np.sqrt(x * x + y * y + z * z)
        valid = sample[(ranges >= p.min_range_m) & (ranges <= p.max_range_m)]  # false for non-finite points
        returns = round(of * len(valid) / max(len(sample), 1))
        if returns < p.min_returns:
            return f"covered: {returns} returns, at least {p.min_returns} needed"
        bearing = np.arctan2(valid[:, 1], valid[:, 0]) / (2.0 * math.pi) + 0.5
        sectors = np.bincount((bearing * p.sectors).astype(np.int64) % p.sectors, minlength=p.sectors)
        share = np.count_nonzero(sectors) / p.sectors
        if share < p.min_sector_share:
            return f"covered: returns from {share:.0%} of all directions, at least {p.min_sector_share:.0%} needed"
        # The noise of a working sensor never repeats a whole sweep.
        return "frozen" if repeated else ""

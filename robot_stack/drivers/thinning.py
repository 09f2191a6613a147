"""Thins a stream of samples to a rate."""

from __future__ import annotations

import math


class Thinning:
    """step_s: period of the thinned stream. slack_s: a sample this much before its time is still chosen."""

    def __init__(self, step_s: float, slack_s: float) -> None:
        self._step_s, self._slack_s = step_s, slack_s
        self._due_s = -math.inf

    def wants(self, stamp_s: float) -> bool:
        """Call with every sample's stamp, in order. True for those to be used."""
        if stamp_s < self._due_s - self._slack_s:
            return False
        behind = stamp_s - self._due_s >= self._step_s  # at the first sample, and after a gap
        self._due_s = (stamp_s if behind else self._due_s) + self._step_s
        return True

    def restart(self) -> None:
        """The next sample is chosen."""
        self._due_s = -math.inf

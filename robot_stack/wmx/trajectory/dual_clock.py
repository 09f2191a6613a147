"""Time on two clocks, so that a paused engine does not count as late."""

from __future__ import annotations

from dataclasses import dataclass

# Timeouts also run while the engine's clock stands or crawls, at this share of the steady time.
_SLOWEST = 0.1


@dataclass(frozen=True, slots=True)
class Moment:
    """One instant. steady_s: this process's clock. engine_s: the engine's, which counts its cycles."""

    steady_s: float
    engine_s: float

    def since(self, begin: Moment) -> float:
        """Seconds that have passed on both clocks."""
        steady_s = self.steady_s - begin.steady_s
        return max(min(steady_s, self.engine_s - begin.engine_s), _SLOWEST * steady_s)

"""How much of the time in which a process was held up may be left out of the ages of its inputs.

A process that did not run has heard no silence, so that a short pause is excused. Excuses are limited: a process that
is held up again and again must not take a dead input for a fresh one. They come from a budget that fills up slowly.
"""

from __future__ import annotations

# A longer pause counts from here on: then a stop is right.
LONGEST_S = 0.25
# Of every second, so much may be excused in the long run. A silence limit of L seconds has then passed after
# (L + LONGEST_S) / (1 - SHARE) seconds at most. A process that is held up at that moment notices it when that pause
# ends: for a limit of 0.1 s after 0.47 s, or after 0.62 s if a pause of 0.15 s begins right before.
SHARE = 0.25


class PauseBudget:
    """Times are plain steady seconds."""

    def __init__(self, now_s: float) -> None:
        self._remaining_s = LONGEST_S
        self._at_s = now_s

    def excuse(self, late_s: float, now_s: float) -> float:
        """Seconds of a pause of ``late_s`` that ended at ``now_s`` which may be left out; 0 for what is no time."""
        elapsed_s = now_s - self._at_s
        if not (elapsed_s >= 0.0 and late_s > 0.0):
            return 0.0
        # The pause itself fills nothing: only time in which the process ran does.
        ran_s = max(0.0, elapsed_s - late_s)
        self._remaining_s = min(LONGEST_S, self._remaining_s + SHARE * ran_s)
        self._at_s = now_s
        excused_s = min(late_s, self._remaining_s)
        self._remaining_s -= excused_s
        return excused_s

"""How much of the time in which a process was paused is subtracted from the ages of its inputs.

A paused process cannot receive messages, so the pause is not an input's silence. The subtraction is limited: a process
that is paused again and again must not accept a dead input as fresh. It comes from a budget that refills slowly.
"""

from __future__ import annotations

# The rest of a longer pause counts as age: a stop is right then.
LONGEST_S = 0.25
# This share of every second may be subtracted in the long run. A timeout of L seconds then expires after
# (L + LONGEST_S) / (1 - SHARE) seconds at most. A process that is paused at that moment detects it when the pause
# ends: for a timeout of 0.1 s after 0.47 s, or after 0.62 s if a pause of 0.15 s begins right before.
SHARE = 0.25


class PauseBudget:
    """Times are plain steady seconds."""

    def __init__(self, now_s: float) -> None:
        self._remaining_s = LONGEST_S
        self._at_s = now_s

    def excuse(self, late_s: float, now_s: float) -> float:
        """Seconds to subtract for a pause of ``late_s`` that ended at ``now_s``; 0 for invalid times."""
        elapsed_s = now_s - self._at_s
        if not (elapsed_s >= 0.0 and late_s > 0.0):
            return 0.0
        # Only time in which the process ran refills the budget, not the pause itself.
        ran_s = max(0.0, elapsed_s - late_s)
        self._remaining_s = min(LONGEST_S, self._remaining_s + SHARE * ran_s)
        self._at_s = now_s
        excused_s = min(late_s, self._remaining_s)
        self._remaining_s -= excused_s
        return excused_s

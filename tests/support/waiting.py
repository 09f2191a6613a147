"""Waits for conditions, never for a fixed time alone."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

ValueT = TypeVar("ValueT")
# Generous, because the machine may be slow; the wait ends as soon as the condition holds.
DEADLINE_S = 45.0
# Shorter deadlines are part of a test. Longer ones only end a failing wait, so scenarios multiply them: a whole robot
# on a slow machine needs more time.
LONG_S = 10.0
USUAL_PATIENCE = 2.0
patience = USUAL_PATIENCE


def wait_for(
    condition: Callable[[], ValueT], what: str, deadline_s: float = DEADLINE_S, poll_s: float = 0.01
) -> ValueT:
    """The first true value of ``condition``. Raises AssertionError naming ``what`` when the deadline passes."""
    deadline_s *= patience if deadline_s >= LONG_S else 1.0
    end_s = time.monotonic() + deadline_s
    while True:
        value = condition()
        if value:
            return value
        assert time.monotonic() < end_s, f"timed out after {deadline_s} s waiting for: {what}"
        time.sleep(poll_s)

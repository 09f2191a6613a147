"""Debouncing of a contact that is read in short intervals."""

from __future__ import annotations

from robot_stack.safety.timing import Hold


class Debounce:
    """Turns raw readings into a state: one confirmed by ``debounce_s`` of equal readings without a break.

    state: the last such state, None before the first.
    """

    def __init__(self, debounce_s: float) -> None:
        self._debounce_s = debounce_s
        self._candidate: bool | None = None
        self._held_for = Hold()
        self.state: bool | None = None

    def update(self, raw: bool, now_s: float) -> bool:
        """A raw reading at steady time ``now_s``; returns True if the state has changed."""
        if raw is not self._candidate:
            self._candidate = raw
            self._held_for.update(False, now_s)
        held_for_s = self._held_for.update(True, now_s)
        if raw is self.state or held_for_s is None or not held_for_s >= self._debounce_s:
            return False
        self.state = raw
        return True
